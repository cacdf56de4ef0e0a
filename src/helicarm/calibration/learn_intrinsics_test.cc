// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double px_in_mm = 1 / 0.15, tolerance_mm = 0.05;
constexpr int balls = 12;
const Vector3d stated(900, 0, 0), sag(1.4, 4.2, 4.2);
const CArmPrior unknown_c_arm{IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}};

CommonPrior printed_phantom(const std::string& name) {
  return {unknown_c_arm,
          std::vector<Eigen::Matrix3d>(balls, tolerance_mm * tolerance_mm * Eigen::Matrix3d::Identity()),
          {},
          0,
          name};
}

/// A C-arm and a printed phantom whose balls lie off their file.
class PhantomScene {
 public:
  explicit PhantomScene(std::uint64_t seed) : random_(seed, 0) {
    mean = scattered(stated, {10, 7, 7});
    offsets = tolerance_mm * unit_errors();
  }

  Vector3d scattered(const Vector3d& about, const Vector3d& sigma) {
    return about + sigma.cwiseProduct(normal_3(random_));
  }
  Matrix3Xd unit_errors() {
    Matrix3Xd errors(3, balls);
    for (auto column : errors.colwise()) column = normal_3(random_);
    return errors;
  }
  /// `turn`: of the view, rad.
  ViewFiducials seen(const Vector3d& intrinsics_mm, double turn, const Matrix3Xd& displaced,
                     double sigma_px) {
    geometry::View view = paper_view(turn);
    view.intrinsics = {px_in_mm * intrinsics_mm.x(), px_in_mm * intrinsics_mm.x(),
                       512 + px_in_mm * intrinsics_mm.y(), 512 + px_in_mm * intrinsics_mm.z(), 0};
    ViewFiducials view_fiducials = observed_fiducials("AP", view, 0.05, random_);
    for (int i = 0; i < balls; ++i) {
      fiducials::Fiducial& ball = view_fiducials.fiducials[std::size_t(i)];
      ball.uv = view.project(ball.centre_in_calibrator + displaced.col(i)) + sigma_px * normal_2(random_);
    }
    view_fiducials.prior = {px_in_mm * stated.x(), Eigen::Vector2d(512, 512), px_in_mm,
                            geometry::NormalPrior{1, 1e-3}};
    return view_fiducials;
  }
  ViewFiducials next_view() { return seen(scattered(mean, sag), 0.2 * random_.uniform(), offsets, 0.05); }
  HistoryEntry entry(const ViewFiducials& view, const CommonPrior& common) {
    return *history_entry_of(view, std::to_string(++count_), common);
  }
  std::vector<HistoryEntry> history(int count) {
    std::vector<HistoryEntry> entries;
    for (int i = 0; i < count; ++i) entries.push_back(entry(next_view(), printed_phantom("phantom")));
    return entries;
  }

  Vector3d mean;
  Matrix3Xd offsets;

 private:
  RandomStream random_;
  int count_ = 0;
};

double focal_mm(const CalibratedView& view) {
  return (view.view.intrinsics.fx + view.view.intrinsics.fy) / 2 / px_in_mm;
}

TEST(HistoryEntryOf, StatesHowTheCalibratorsErrorsMoveTheEstimate) {
  PhantomScene scene(41);
  const Matrix3Xd unit_errors = 0.2 * scene.unit_errors();
  const Vector3d truth(905, 4, -3);
  const CommonPrior common = printed_phantom("phantom");
  const HistoryEntry exact = scene.entry(scene.seen(truth, 0.4, Matrix3Xd::Zero(3, balls), 0), common);
  const HistoryEntry displaced = scene.entry(scene.seen(truth, 0.4, tolerance_mm * unit_errors, 0), common);
  const Vector3d moved = displaced.estimate_mm - exact.estimate_mm;
  const Vector3d stated = exact.by_calibrator * unit_errors.reshaped();
  EXPECT_GT(stated.norm(), 1);
  EXPECT_LT((moved - stated).norm(), 0.1 * stated.norm()) << moved << "\n" << stated;
}

TEST(HistoryEntryOf, KnowsNoErrorsOfAnExactCalibrator) {
  PhantomScene scene(42);
  const HistoryEntry entry =
      scene.entry(scene.seen(stated, 0.4, Matrix3Xd::Zero(3, balls), 0.05), {unknown_c_arm});
  EXPECT_EQ(entry.calibrator, "");
  EXPECT_EQ(entry.by_calibrator.cols(), 0);
  EXPECT_EQ(entry.nominal_focal_mm, stated.x());
}

TEST(LearnIntrinsics, ManyImagesOfOnePhantomKeepItsErrors) {
  double chi2 = 0, as_independent = 0;
  const int trials = 100;
  for (int trial = 0; trial < trials; ++trial) {
    PhantomScene scene(1000 + std::uint64_t(trial));
    std::vector<HistoryEntry> entries = scene.history(30);
    const auto add = [&](double& sum) {
      const LearnedIntrinsics known = learn_intrinsics(entries, stated, unknown_c_arm);
      sum += std::pow((known.mean_mm() - scene.mean).x() / known.deviation.prior.focal->common, 2) / trials;
    };
    add(chi2);
    for (HistoryEntry& entry : entries) entry.calibrator.clear(), entry.by_calibrator.resize(3, 0);
    add(as_independent);
  }
  EXPECT_NEAR(chi2, 1, 0.5);
  EXPECT_GT(as_independent, 3);
}

TEST(LearnIntrinsics, ErrorsOfThePhantomCountOnceInItsNextImage) {
  double chi2 = 0;
  const int trials = 100;
  for (int trial = 0; trial < trials; ++trial) {
    PhantomScene scene(200 + std::uint64_t(trial));
    CalibrationOptions options;
    options.common = printed_phantom("phantom");
    const LearnedIntrinsics known = learn_intrinsics(scene.history(30), stated, unknown_c_arm, "phantom");
    EXPECT_EQ(known.of_calibrator.prior.by_ball_errors.cols(), 3 * balls);
    options.common.c_arm = known.of_calibrator.prior;
    const Vector3d truth = scene.scattered(scene.mean, sag);
    ViewFiducials view = scene.seen(truth, 0.7, scene.offsets, 0.05);
    view.prior = learned_prior(view.prior, known.of_calibrator.mm, false);
    const auto found = calibrate({view}, options);
    ASSERT_TRUE(found) << found.error().message;
    const ViewCovariance& covariance = found->views[0].covariance;
    const double sigma = std::sqrt(covariance.topLeftCorner<2, 2>().sum()) / 2 / px_in_mm;
    chi2 += std::pow((focal_mm(found->views[0]) - truth.x()) / sigma, 2) / trials;
  }
  EXPECT_NEAR(chi2, 1, 0.5);
}

TEST(LearnIntrinsics, DeviationsHoldForViewsOfOtherSourceDistances) {
  std::vector<HistoryEntry> entries;
  for (int i = 0; i < 8; ++i) {
    HistoryEntry entry{std::to_string(i), "AP", {i % 2 ? 1025. : 905., 1, 2}, Eigen::Matrix3d::Identity()};
    entry.nominal_focal_mm = i % 2 ? 1020 : 900;
    entries.push_back(entry);
  }
  const LearnedIntrinsics known = learn_intrinsics(entries, {1020, 0, 0}, unknown_c_arm);
  EXPECT_NEAR(known.deviation.mm.x(), 5, 0.1);
  EXPECT_LT(known.deviation.prior.focal->of_view, 2);
  const geometry::IntrinsicsPrior lateral{900 * px_in_mm, Eigen::Vector2d(512, 512), px_in_mm};
  EXPECT_NEAR(*learned_prior(lateral, known.deviation.mm, false).focal_px, 905 * px_in_mm, 1);
}

TEST(CheckCArm, AnotherPhantomsErrorsAreNoChange) {
  int changed = 0;
  double chi2 = 0;
  const int trials = 30;
  for (int trial = 0; trial < trials; ++trial) {
    PhantomScene scene(300 + std::uint64_t(trial));
    const CArmModel model = c_arm_model(scene.history(24), stated, unknown_c_arm);
    const Matrix3Xd exact = Matrix3Xd::Zero(3, balls);
    const HistoryEntry next =
        scene.entry(scene.seen(scene.scattered(scene.mean, sag), 0.7, exact, 0.05), {unknown_c_arm});
    const CArmCheck check = check_c_arm(model, std::vector{next}, {});
    changed += check.changed;
    chi2 += check.chi2 / trials;
  }
  EXPECT_EQ(changed, 0);
  EXPECT_NEAR(chi2, 3, 1.5);
}

TEST(CheckCArm, ThePhantomsOwnErrorsAreNoneInItsNextImages) {
  PhantomScene scene(44);
  std::vector<HistoryEntry> entries;
  const auto taken = [&](const Vector3d& change) {
    HistoryEntry entry =
        scene.entry(scene.seen(scene.mean + change + scene.scattered(Vector3d::Zero(), {0.1, 0.1, 0.1}), 0.7,
                               scene.offsets, 0.05),
                    printed_phantom("phantom"));
    entry.primary_deg = entry.secondary_deg = 0;
    return entry;
  };
  for (int i = 0; i < 20; ++i) entries.push_back(taken(Vector3d::Zero()));
  const CArmModel model = c_arm_model(entries, stated, unknown_c_arm);
  const CArmCheck alike = check_c_arm(model, std::vector{taken(Vector3d::Zero())}, {});
  EXPECT_FALSE(alike.changed);
  const double alone = std::sqrt(entries.front().information.inverse()(0, 0));
  EXPECT_LT(alike.acquisitions[0].sigma_mm.x(), 0.5 * alone);
}

}  // namespace
}  // namespace helicarm::calibration
