// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/mount_calibration.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/pose_step.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace mount_calibration_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::RigidTransform;

const RigidTransform calibrator_from_facet{geometry::rotation_from_euler(0.3, -1.2, 2), {95, -20, 40}};
const RigidTransform tracker_from_facet{geometry::rotation_from_euler(2.8, 0.2, -0.5), {40, -60, 1100}};
const Vector3d tip(2, -140, -20);

/// Five places on a cone of 80 mm, as on the calibrator.
std::map<std::string, MountPlace> places(double radius_mm = 0) {
  std::map<std::string, MountPlace> places;
  for (const auto& [label, at] : {std::pair("P1", Vector3d(60, 35, 5)),
                                  {"P4", {-38, 52, 22}},
                                  {"P7", {-50, -29, 45}},
                                  {"P9", {40, 10, 62}},
                                  {"P12", {10, -28, 80}}})
    places[label] = {at, radius_mm};
  return places;
}

Vector3d normal(RandomStream& random) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return {x, y, z};
}

RigidTransform noisy(const RigidTransform& pose, const MountOptions& noise, RandomStream& random) {
  const Vector3d shift = noise.sigma_mm * normal(random);
  const Vector3d turn = noise.sigma_deg * std::numbers::pi / 180 * normal(random);
  return pose * RigidTransform{geometry::rotation_from_vector(turn), shift};
}

MountOptions exact() {
  MountOptions options;
  options.sigma_mm = options.sigma_deg = 0;
  options.seat_mm = 1e-3;
  options.tip_covariance = Matrix3d::Zero();
  return options;
}

MountOptions with_exact_tip() {
  MountOptions options;
  options.tip_covariance = Matrix3d::Zero();
  return options;
}

/// The pointer, held upright within 30 degrees, with its tip at a place; on a ball it touches from its side.
RigidTransform pointer_at(const MountPlace& place, const Vector3d& true_tip, RandomStream& random) {
  const Matrix3d turn = geometry::rotation_from_vector(0.3 * normal(random));
  const Vector3d from = (tracker_from_facet * calibrator_from_facet.inverse()) * place.centre_in_calibrator;
  const Vector3d side = (turn * -true_tip).normalized();
  return {turn, from + place.radius_mm * side - turn * true_tip};
}

/// `touches` of each place, with errors of the given size.
std::vector<MountObservation> touched(const std::map<std::string, MountPlace>& places,
                                      const MountOptions& noise, RandomStream& random, int touches = 1) {
  const Vector3d true_tip =
      tip +
      noise.tip_covariance.value_or(Matrix3d::Zero()).diagonal().cwiseSqrt().cwiseProduct(normal(random));
  const RigidTransform facet = noisy(tracker_from_facet, noise, random);  // at rest: one error for all
  std::vector<MountObservation> observations;
  for (const auto& [label, place] : places)
    for (int i = 0; i < touches; ++i) {
      MountPlace seat = place;
      seat.centre_in_calibrator += noise.seat_mm * normal(random);
      observations.push_back(
          touched_place(label, facet, noisy(pointer_at(seat, true_tip, random), noise, random), tip, noise));
    }
  return observations;
}

double squared_error(const MountCalibration& mount) {
  const geometry::PoseStep error = geometry::step_between(mount.calibrator_from_facet, calibrator_from_facet);
  return error.dot(mount.covariance.llt().solve(error));
}

TEST(MountCalibration, ExactTouchesGiveTheMount) {
  RandomStream random(1, 1);
  for (const double radius_mm : {0.0, 2.0}) {
    const auto at = places(radius_mm);
    const auto mount = calibrate_mount(at, touched(at, exact(), random, 4), exact());
    ASSERT_TRUE(mount) << mount.error().message;
    EXPECT_LT((mount->calibrator_from_facet.translation - calibrator_from_facet.translation).norm(), 0.01);
    EXPECT_LT((mount->calibrator_from_facet.rotation - calibrator_from_facet.rotation).norm(), 1e-4);
    EXPECT_LT(mount->fre_mm, 0.01);
    EXPECT_TRUE(mount->exchangeable.empty());
  }
}

/// Share of 400 calibrations whose 95 % region holds the truth.
double coverage(double radius_mm, int touches) {
  constexpr double chi2_95_of_six = 12.592;
  constexpr int trials = 400;
  MountOptions options;
  options.tip_covariance = 0.04 * Matrix3d::Identity();
  options.max_tre_mm = 5;
  int covered = 0;
  for (int i = 0; i < trials; ++i) {
    RandomStream random(7, 1, static_cast<std::uint64_t>(i));
    const auto at = places(radius_mm);
    const auto mount = calibrate_mount(at, touched(at, options, random, touches), options);
    covered += mount && squared_error(*mount) <= chi2_95_of_six;
  }
  return double(covered) / trials;
}

TEST(MountCalibration, CovarianceHoldsTheTruthOfTouchedDivots) { EXPECT_NEAR(coverage(0, 1), 0.95, 0.025); }

TEST(MountCalibration, CovarianceHoldsTheTruthOfTouchedBalls) { EXPECT_NEAR(coverage(2, 3), 0.95, 0.025); }

/// Touches from any side have false minima: a mount that is returned is never far beyond its prediction.
TEST(MountCalibration, TouchesOnAllSidesOfBallsGiveNoFalseMount) {
  constexpr double chi2_of_six_at_1e_6 = 38.3;
  MountOptions options;
  options.tip_covariance = 0.01 * Matrix3d::Identity();
  options.max_tre_mm = 5;
  int given = 0;
  for (std::uint64_t trial = 0; trial < 100; ++trial) {
    RandomStream random(11, 3, trial);
    const auto at = places(2);
    const RigidTransform facet = noisy(tracker_from_facet, options, random);
    std::vector<MountObservation> observations;
    for (const auto& [label, place] : at)
      for (int i = 0; i < 3; ++i) {
        const Matrix3d turn = geometry::rotation_from_vector(3 * normal(random));
        const Vector3d centre =
            (tracker_from_facet * calibrator_from_facet.inverse()) * place.centre_in_calibrator;
        const Vector3d side = (turn * -tip).normalized();
        const RigidTransform pointer{turn, centre + place.radius_mm * side - turn * tip};
        observations.push_back(touched_place(label, facet, noisy(pointer, options, random), tip, options));
      }
    const auto mount = calibrate_mount(at, observations, options);
    if (!mount) continue;
    ++given;
    EXPECT_LT(squared_error(*mount), chi2_of_six_at_1e_6) << trial;
  }
  EXPECT_GT(given, 90);
}

TEST(MountCalibration, PivotsAboutThreePlacesGiveTheMount) {
  std::vector<MountObservation> observations;
  for (const auto& [label, place] : places()) {
    PivotCalibration pivot;
    pivot.tip_in_tool = calibrator_from_facet.inverse() * place.centre_in_calibrator;
    pivot.covariance = 0.01 * Eigen::Matrix<double, 6, 6>::Identity();
    observations.push_back(pivoted_place(label, pivot));
  }
  const auto mount = calibrate_mount(places(), observations, with_exact_tip());
  ASSERT_TRUE(mount) << mount.error().message;
  EXPECT_LT((mount->calibrator_from_facet.translation - calibrator_from_facet.translation).norm(), 1e-6);
  observations.resize(1);
  EXPECT_EQ(calibrate_mount(places(), observations, with_exact_tip()).error().reason,
            Reason::poses_too_alike);
}

TEST(MountCalibration, ExchangedPlacesAreNamed) {
  RandomStream random(2, 1);
  auto observations = touched(places(), with_exact_tip(), random);
  std::swap(observations[1].label, observations[3].label);
  const auto mount = calibrate_mount(places(), observations, with_exact_tip());
  ASSERT_FALSE(mount);
  EXPECT_EQ(mount.error().reason, Reason::residual_too_large);
  const std::string& a =
      observations[1].label < observations[3].label ? observations[1].label : observations[3].label;
  EXPECT_NE(mount.error().message.find("\"" + a + "\" and"), std::string::npos) << mount.error().message;
  EXPECT_NE(mount.error().message.find("exchanged"), std::string::npos);
}

TEST(MountCalibration, SlippedTouchIsNamed) {
  RandomStream random(3, 1);
  auto observations = touched(places(), with_exact_tip(), random);
  observations[2].point_in_facet += Vector3d(0, 3, 0);
  const auto mount = calibrate_mount(places(), observations, with_exact_tip());
  ASSERT_FALSE(mount);
  EXPECT_NE(mount.error().message.find("\"" + observations[2].label + "\" was touched"), std::string::npos)
      << mount.error().message;
}

TEST(MountCalibration, MirroredCalibratorIsNamed) {
  RandomStream random(4, 1);
  auto mirrored = places();
  for (auto& [label, place] : mirrored) place.centre_in_calibrator.x() *= -1;
  const auto mount = calibrate_mount(mirrored, touched(places(), with_exact_tip(), random), with_exact_tip());
  ASSERT_FALSE(mount);
  EXPECT_NE(mount.error().message.find("mirror"), std::string::npos) << mount.error().message;
}

TEST(MountCalibration, PlacesAlongALineAreRefused) {
  RandomStream random(5, 1);
  std::map<std::string, MountPlace> line;
  for (const auto& [label, x] : {std::pair("A", 0.0), {"B", 30.0}, {"C", 60.0}})
    line[label] = {{x, x / 2, 10}, 0};
  EXPECT_EQ(calibrate_mount(line, touched(line, with_exact_tip(), random), with_exact_tip()).error().reason,
            Reason::poses_too_alike);
}

TEST(MountCalibration, OneTouchOfEachBallIsTooFew) {
  RandomStream random(6, 1);
  const auto at = places(2);
  EXPECT_EQ(calibrate_mount(at, touched(at, with_exact_tip(), random), with_exact_tip()).error().reason,
            Reason::poses_too_alike);
}

TEST(MountCalibration, SymmetricPlacesReportWhatTheyWouldNotShow) {
  RandomStream random(8, 1);
  std::map<std::string, MountPlace> isosceles;
  for (const auto& [label, at] : {std::pair("A", Vector3d(0, 60, 0)), {"B", {-40, 0, 0}}, {"C", {40, 0, 0}}})
    isosceles[label] = {at, 0};
  MountOptions options = with_exact_tip();
  options.max_tre_mm = 5;
  const auto mount = calibrate_mount(isosceles, touched(isosceles, options, random), options);
  ASSERT_TRUE(mount) << mount.error().message;
  ASSERT_EQ(mount->exchangeable.size(), 1u);
  EXPECT_EQ(mount->exchangeable[0], (std::pair<std::string, std::string>("B", "C")));
}

TEST(MountCalibration, LargePredictedErrorIsRefused) {
  RandomStream random(9, 1);
  MountOptions options = with_exact_tip();
  options.sigma_mm = 1;
  const auto mount = calibrate_mount(places(), touched(places(), options, random), options);
  ASSERT_FALSE(mount);
  EXPECT_EQ(mount.error().reason, Reason::uncertain);
}

/// Touches by a pointer whose tip is 2 mm from where its file has it, held within `tilt` rad of upright.
std::vector<MountObservation> touched_by_bent_pointer(double tilt, RandomStream& random) {
  const Vector3d bent = tip + Vector3d(1.2, -1.2, 1.0);
  std::vector<MountObservation> observations;
  for (const auto& [label, place] : places())
    for (int i = 0; i < 6; ++i) {
      const Matrix3d turn = geometry::rotation_from_vector(tilt * normal(random));
      const Vector3d at = tracker_from_facet * calibrator_from_facet.inverse() * place.centre_in_calibrator;
      observations.push_back(touched_place(
          label, tracker_from_facet,
          noisy({turn, at + MountOptions().seat_mm * normal(random) - turn * bent}, {}, random), tip));
    }
  return observations;
}

TEST(MountCalibration, TipWithoutCovarianceIsDeterminedByTheTouchesOfATiltedPointer) {
  constexpr double chi2_95_of_six = 12.592;
  int covered = 0;
  for (std::uint64_t trial = 0; trial < 40; ++trial) {
    RandomStream random(12, 1, trial);
    const auto mount = calibrate_mount(places(), touched_by_bent_pointer(0.5, random));
    ASSERT_TRUE(mount) << mount.error().message;
    EXPECT_LT((mount->tip_shift_mm - Vector3d(1.2, -1.2, 1.0)).norm(), 0.5);
    covered += squared_error(*mount) <= chi2_95_of_six;
  }
  EXPECT_GE(covered, 34);  // three standard deviations below 95 %
}

TEST(MountCalibration, TipWithoutCovarianceIsNotTakenAsExactWhereTheTouchesDoNotShowIt) {
  RandomStream random(13, 1);
  const auto mount = calibrate_mount(places(), touched_by_bent_pointer(0.005, random));
  ASSERT_FALSE(mount);
  EXPECT_EQ(mount.error().reason, Reason::uncertain);
  EXPECT_NE(mount.error().message.find("tracker pivot"), std::string::npos) << mount.error().message;
}

TEST(MountCalibration, UnknownPlaceIsRefused) {
  RandomStream random(10, 1);
  auto observations = touched(places(), with_exact_tip(), random);
  observations[0].label = "P99";
  EXPECT_EQ(calibrate_mount(places(), observations, with_exact_tip()).error().reason, Reason::bad_value);
}

}  // namespace mount_calibration_test
}  // namespace helicarm::tracker
