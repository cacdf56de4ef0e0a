// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/scale.h"

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
