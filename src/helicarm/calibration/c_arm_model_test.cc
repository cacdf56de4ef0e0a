// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_model.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/core/statistics.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Vector3d arm_nominal_mm(1000, 0, 0);
const CArmPrior unknown_arm{IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}};

/// A C-arm whose sag is a sine of its primary angle: 1 mm in the source distance, 2 mm in the principal
/// point.
class SaggingArm {
 public:
  explicit SaggingArm(std::uint64_t seed) : random_(seed, 0) {}

  HistoryEntry acquisition(double primary_deg, const Vector3d& change_mm = Vector3d::Zero()) {
    const double turn = primary_deg * std::numbers::pi / 180;
    const Vector3d truth = Vector3d(1004, 3, -2) + std::sin(turn) * Vector3d(1, 2, 0) +
                           std::cos(turn) * Vector3d(0.3, 0, 1.5) + change_mm;
    const Vector3d sigma(1.2, 0.4, 0.4);
    Vector3d noise;
    for (double& value : noise) value = random_.normal();
    const Vector3d repeat = 0.1 * Vector3d(random_.normal(), random_.normal(), random_.normal());
    HistoryEntry entry{std::to_string(++count_), "AP", truth + repeat + sigma.cwiseProduct(noise),
                       sigma.cwiseAbs2().cwiseInverse().asDiagonal().toDenseMatrix()};
    entry.primary_deg = primary_deg;
    entry.secondary_deg = 0;
    return entry;
  }
  std::vector<HistoryEntry> history(int count) {
    std::vector<HistoryEntry> entries;
    for (int i = 0; i < count; ++i) entries.push_back(acquisition(-90 + 180. * i / (count - 1)));
    return entries;
  }

 private:
  RandomStream random_;
  int count_ = 0;
};

TEST(CArmModel, WithoutAcquisitionsPredictsTheNominalValuesWithTheirDoubt) {
  const CArmModel model = c_arm_model({}, arm_nominal_mm, unknown_arm);
  const HistoryEntry at{"", "AP", {}, Matrix3d::Identity(), 0, 0};
  const IntrinsicsPrediction predicted = predict_intrinsics(model, {&at, 1});
  EXPECT_EQ(predicted.mean_mm, arm_nominal_mm);
  EXPECT_GT(predicted.covariance_mm2(0, 0), 100);
}

TEST(CArmModel, SagIsPredictedAtPositionsThatWereNotAcquired) {
  SaggingArm arm(1);
  const CArmModel model = c_arm_model(arm.history(24), arm_nominal_mm, unknown_arm);
  for (const double angle : {-70., -20., 35., 80.}) {
    const HistoryEntry at{"", "AP", {}, Matrix3d::Identity(), angle, 0};
    const IntrinsicsPrediction predicted = predict_intrinsics(model, {&at, 1});
    const double turn = angle * std::numbers::pi / 180;
    EXPECT_NEAR(predicted.mean_mm[1], 3 + 2 * std::sin(turn), 4 * std::sqrt(predicted.covariance_mm2(1, 1)));
    EXPECT_LT(std::sqrt(predicted.covariance_mm2(1, 1)), 0.6);
  }
}

TEST(CArmModel, NextAcquisitionsLieInTheirRegions) {
  int inside = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SaggingArm arm(seed);
    const CArmModel model = c_arm_model(arm.history(16), arm_nominal_mm, unknown_arm);
    for (const double angle : {-60., -15., 40., 75.}) {
      const HistoryEntry next = arm.acquisition(angle);
      const CArmCheck check = check_c_arm(model, {&next, 1}, {});
      constexpr double chi2_at_95 = 7.815;  // three degrees of freedom
      inside += check.acquisitions.front().chi2 < chi2_at_95;
      ++all;
    }
  }
  EXPECT_GE(inside, 0.90 * all);
  EXPECT_LE(inside, 0.99 * all);
}

TEST(CArmModel, UnchangedArmRaisesNoAlarm) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SaggingArm arm(seed);
    const CArmModel model = c_arm_model(arm.history(12), arm_nominal_mm, unknown_arm);
    const std::vector next{arm.acquisition(0), arm.acquisition(88)};
    alarms += check_c_arm(model, next, {}).changed;
  }
  EXPECT_LE(alarms, 1);
}

TEST(CArmModel, ReceiverMovedByTwoMillimetresIsAChange) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SaggingArm arm(seed);
    const CArmModel model = c_arm_model(arm.history(24), arm_nominal_mm, unknown_arm);
    const std::vector next{arm.acquisition(0, {0, 2, 2}), arm.acquisition(88, {0, 2, 2})};
    alarms += check_c_arm(model, next, {}).changed;
  }
  EXPECT_GE(alarms, 18);
}

TEST(CArmModel, OnlyTheAcquisitionsThatShowTheChangeAreMarked) {
  SaggingArm arm(5);
  const CArmModel model = c_arm_model(arm.history(24), arm_nominal_mm, unknown_arm);
  const std::vector next{arm.acquisition(0), arm.acquisition(88, {0, 20, 20})};
  const CArmCheck check = check_c_arm(model, next, {});
  ASSERT_TRUE(check.changed);
  EXPECT_FALSE(check.acquisitions[0].is_changed);
  EXPECT_TRUE(check.acquisitions[1].is_changed);
}

TEST(CArmModel, ChangeWithinTheToleranceIsNone) {
  SaggingArm arm(3);
  const CArmModel model = c_arm_model(arm.history(24), arm_nominal_mm, unknown_arm);
  const std::vector next{arm.acquisition(0, {0, 4, 4}), arm.acquisition(88, {0, 4, 4})};
  EXPECT_TRUE(check_c_arm(model, next, {0, 0}).changed);
  EXPECT_FALSE(check_c_arm(model, next, {20, 20}).changed);
}

TEST(CArmModel, ImagesWithoutAnglesAreNotTakenForOnePosition) {
  SaggingArm arm(4);
  std::vector<HistoryEntry> entries = arm.history(10);
  for (HistoryEntry& entry : entries) entry.primary_deg.reset();
  const CArmModel model = c_arm_model(entries, arm_nominal_mm, unknown_arm);
  HistoryEntry next = arm.acquisition(0);
  next.primary_deg.reset();
  EXPECT_FALSE(check_c_arm(model, {&next, 1}, {}).changed);
}

TEST(CArmModel, DriftIsFoundBesideTheSag) {
  int inside = 0;
  for (const double drift : {0.0, 4.0})
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      SaggingArm arm(seed);
      std::vector<HistoryEntry> entries;
      for (int month = 0; month < 12; ++month)
        for (const double angle : {0.0, 40.0, 80.0}) {
          entries.push_back(arm.acquisition(angle, Vector3d(drift * month / 12, 0, 0)));
          entries.back().date = fmt::format("2026-{:02}-10", 1 + month);
        }
      const auto found = c_arm_drift(c_arm_model(entries, arm_nominal_mm, unknown_arm));
      ASSERT_TRUE(found);
      inside += std::abs(found->mm_a_year.x() - drift) < 1.96 * found->sigma.x();
      EXPECT_LT(found->sigma.x(), 2);
      for (HistoryEntry& entry : entries) entry.date = "2026-05-05";
      EXPECT_FALSE(c_arm_drift(c_arm_model(entries, arm_nominal_mm, unknown_arm)));
      entries.front().date.clear();  // which is no other day
      EXPECT_FALSE(c_arm_drift(c_arm_model(entries, arm_nominal_mm, unknown_arm)));
    }
  EXPECT_GE(inside, 13);
}

}  // namespace
}  // namespace helicarm::calibration
