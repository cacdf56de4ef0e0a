// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/scale.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::MatrixXd;

/// The helix at a wrong scale, as images give it, with a covariance of 0.01 mm per axis.
struct Unscaled {
  std::vector<Eigen::Vector3d> truth = helix_centres();
  std::vector<Eigen::Vector3d> centres;
  std::vector<std::string> labels;
  MatrixXd covariance;

  Unscaled() {
    for (const phantom::CalibratorBall& ball : phantom::udcsc().balls) {
      centres.push_back(ball.centre_in_calibrator / 1.1);
      labels.push_back(ball.label);
    }
    covariance = 1e-4 * MatrixXd::Identity(36, 36);
  }
  double distance(std::size_t a, std::size_t b) const { return (truth[a] - truth[b]).norm(); }
};

TEST(Scale, OneDistanceGivesTheScaleAndItsSigma) {
  const Unscaled given;
  const double distance = given.distance(0, 2);
  const auto scaled = scaled_by(given.centres, given.covariance, {{0, 2, distance, 0.05}}, given.labels);
  ASSERT_TRUE(scaled) << scaled.error().message;
  for (std::size_t i = 0; i < given.truth.size(); ++i)
    EXPECT_LT((scaled->centres[i] - given.truth[i]).norm(), 1e-6);
  const double expected = std::hypot(0.05, std::sqrt(2.0) * 0.011) / distance;
  EXPECT_NEAR(scaled->scale_sigma, expected, 0.1 * expected);
}

TEST(Scale, ErrorOfTheDistanceIsOneSharedNumberInEveryCovariance) {
  const Unscaled given;
  const auto scaled = scaled_by(given.centres, MatrixXd::Zero(36, 36) + 1e-12 * MatrixXd::Identity(36, 36),
                                {{0, 2, given.distance(0, 2), 0.5}}, given.labels);
  ASSERT_TRUE(scaled) << scaled.error().message;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled->covariance_mm2);
  EXPECT_GT(eigen.eigenvalues()[35], 1e6 * std::abs(eigen.eigenvalues()[34]));
}

TEST(Scale, TwoDistancesThatAgreeHalveTheVariance) {
  const Unscaled given;
  const auto one =
      scaled_by(given.centres, given.covariance, {{0, 2, given.distance(0, 2), 0.2}}, given.labels);
  const auto two =
      scaled_by(given.centres, given.covariance,
                {{0, 2, given.distance(0, 2), 0.2}, {0, 1, given.distance(0, 1), 0.2}}, given.labels);
  ASSERT_TRUE(one && two);
  EXPECT_LT(two->scale_sigma, 0.85 * one->scale_sigma);
}

TEST(Scale, SeveralFineDistancesLeaveTheirMeansError) {
  const Unscaled given;
  constexpr double sigma_mm = 0.005;
  std::vector<CentreDistance> distances;
  double information = 0;
  for (std::size_t k = 1; k < 7; ++k) {
    distances.push_back({0, k, given.distance(0, k), sigma_mm});
    information += std::pow(given.distance(0, k) / sigma_mm, 2);
  }
  const auto scaled =
      scaled_by(given.centres, MatrixXd(1e-12 * MatrixXd::Identity(36, 36)), distances, given.labels);
  ASSERT_TRUE(scaled) << scaled.error().message;
  EXPECT_NEAR(scaled->scale_sigma * std::sqrt(information), 1, 0.01);
}

TEST(Scale, DistancesThatContradictEachOtherAreRefusedByName) {
  const Unscaled given;
  const auto scaled = scaled_by(given.centres, given.covariance,
                                {{0, 2, given.distance(0, 2), 0.05},
                                 {0, 1, given.distance(0, 1), 0.05},
                                 {4, 6, given.distance(4, 6) + 1, 0.05}},
                                given.labels);
  ASSERT_FALSE(scaled);
  EXPECT_EQ(scaled.error().reason, Reason::distances_disagree);
  EXPECT_NE(scaled.error().message.find("P5 to P7"), std::string::npos) << scaled.error().message;
}

TEST(Scale, DiametersGiveEveryPointTheirRelativeError) {
  const Unscaled given;
  const auto scaled = scaled_by(given.centres, given.covariance, 1.1, 0.03);
  EXPECT_EQ(scaled.scale_sigma, 0.03);
  EXPECT_LT((scaled.centres[5] - given.truth[5]).norm(), 1e-9);
  EXPECT_GT(scaled.covariance_mm2(0, 0), std::pow(0.03 * 40, 2));
}

TEST(Scale, FurtherErrorOfTheScaleIsAddedOnce) {
  const Unscaled given;
  const auto scaled = with_scale_error(scaled_by(given.centres, given.covariance, 1.1, 0.03), 0.04);
  EXPECT_NEAR(scaled.scale_sigma, 0.05, 1e-12);
  const auto at_once = scaled_by(given.centres, given.covariance, 1.1, 0.05);
  EXPECT_LT((scaled.covariance_mm2 - at_once.covariance_mm2).norm(), 1e-9);
}

/// The codes of the warnings, or of the refusal.
std::vector<Reason> found_by_check(const ScaleComparison& comparison) {
  std::vector<Warning> warnings;
  const auto checked = check_scale(comparison, warnings);
  std::vector<Reason> reasons;
  for (const Warning& warning : warnings) reasons.push_back(warning.reason);
  if (!checked) return {};
  return reasons.empty() ? std::vector{Reason::usage} : reasons;
}

TEST(Scale, ScalesWithinThreeSigmaAgree) {
  EXPECT_EQ(found_by_check({"a", "b", 1.025, 0.01, "", {}}), std::vector{Reason::usage});
}

TEST(Scale, ScalesBeyondThreeSigmaAreWarnedOfAndBeyondTenRefused) {
  EXPECT_EQ(found_by_check({"a", "b", 0.96, 0.01, "", {}}), std::vector{Reason::scale_disagrees});
  EXPECT_TRUE(found_by_check({"a", "b", 1.12, 0.01, "", {}}).empty());
}

TEST(Scale, DoubtfulScaleIsWarnedOfWhereAnotherReadingAgrees) {
  EXPECT_EQ(found_by_check({"a", "b", 1.025, 0.01, "taken as outer distances", 1.002}),
            std::vector{Reason::scale_disagrees});
  EXPECT_EQ(found_by_check({"a", "b", 1.025, 0.01, "taken as outer distances", 0.985}),
            std::vector{Reason::usage});
}

TEST(Scale, WarningStatesBothFigures) {
  std::vector<Warning> warnings;
  ASSERT_TRUE(check_scale({"the distances", "the diameters", 1.04, 0.012, "taken as outer distances", 1.004},
                          warnings));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].message.find("1.04 times as large as the diameters"), std::string::npos)
      << warnings[0].message;
  EXPECT_NE(warnings[0].message.find("taken as outer distances: 1.004"), std::string::npos);
}

TEST(Scale, PairWorthMeasuringIsALongOne) {
  const Unscaled given;
  const auto pair = best_pair(given.truth, given.covariance, 0.05);
  double longest = 0;
  for (std::size_t a = 0; a < 12; ++a)
    for (std::size_t b = 0; b < a; ++b) longest = std::max(longest, given.distance(a, b));
  EXPECT_DOUBLE_EQ(pair.distance_mm, longest);
}

TEST(Scale, PairWorthMeasuringAvoidsAnUncertainFiducial) {
  Unscaled given;
  const auto usual = best_pair(given.truth, given.covariance, 0.05);
  given.covariance.block<3, 3>(3 * Eigen::Index(usual.a), 3 * Eigen::Index(usual.a)) *= 1e4;
  const auto pair = best_pair(given.truth, given.covariance, 0.05);
  EXPECT_NE(pair.a, usual.a);
  EXPECT_NE(pair.b, usual.a);
}

}  // namespace
}  // namespace helicarm::phantom_calibration
