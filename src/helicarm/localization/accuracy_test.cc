// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/accuracy.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::localization {
namespace {

TEST(StatisticsOf, TwoValues) {
  const std::vector<double> errors{3, 4};
  const Statistics s = statistics_of(errors);
  EXPECT_EQ(s.mean, 3.5);
  EXPECT_EQ(s.rms, std::sqrt(12.5));
  EXPECT_EQ(s.max, 4);
  EXPECT_EQ(s.min, 3);
  EXPECT_EQ(s.n, 2);
  EXPECT_EQ(statistics_of({}).n, 0);
}

std::vector<calibration::ViewFiducials> observed_balls(double sigma, std::uint64_t trial,
                                                       const std::vector<double>& angles = {0.0, 1.5}) {
  std::vector<calibration::ViewFiducials> views;
  RandomStream random(31, 0, trial);
  for (double alpha : angles) {
    const Eigen::Matrix3d rotation = geometry::rotation_from_euler(alpha, 0, 0);
    const geometry::View view{{6000, 6000, 512, 512, 0}, {rotation, {0, 0, 800}}};
    calibration::ViewFiducials seen{fmt::format("{}", alpha), {}};
    for (int k = 0; k < 12; ++k) {
      const double t = 0.5 + k * 1.57;
      fiducials::Fiducial f{fmt::format("P{}", k), {50 * std::cos(t), 50 * std::sin(t), 4 * t - 40}};
      f.status = fiducials::FiducialStatus::used;
      f.sigma_px = sigma;
      f.uv = view.project(f.centre_in_calibrator) + sigma * normal_2(random);
      seen.fiducials.push_back(f);
    }
    views.push_back(seen);
  }
  return views;
}

TEST(FiducialLocalizationError, EqualsTheNoiseForBothMethods) {
  const double sigma = 0.4;
  for (auto method : {calibration::calibrate, calibration::calibrate_paper}) {
    double mean = 0, rms2 = 0;
    const int trials = 200;
    for (int trial = 0; trial < trials; ++trial) {
      const auto result = method(observed_balls(sigma, std::uint64_t(trial)), {});
      ASSERT_TRUE(result.has_value());
      const Statistics fle = fiducial_localization_error(*result);
      mean += fle.mean / trials;
      rms2 += fle.rms * fle.rms / trials;
    }
    EXPECT_NEAR(mean, sigma * std::sqrt(std::acos(-1) / 2), 0.02);  // of a Rayleigh distribution
    EXPECT_NEAR(std::sqrt(rms2), sigma * std::sqrt(2.0), 0.02);
  }
}

enum class BallErrors { exact, as_stated, below_stated, correlated };
class FleOf : public testing::TestWithParam<BallErrors> {};
INSTANTIATE_TEST_SUITE_P(FiducialLocalizationError, FleOf,
                         testing::Values(BallErrors::exact, BallErrors::as_stated, BallErrors::below_stated,
                                         BallErrors::correlated));

/// Errors of a measured calibrator, mm: independent ones and a strain that all fiducials share.
Eigen::MatrixXd measured_covariance(const std::vector<fiducials::Fiducial>& balls) {
  const auto n = Eigen::Index(balls.size());
  Eigen::MatrixXd covariance = 0.01 * 0.01 * Eigen::MatrixXd::Identity(3 * n, 3 * n);
  Eigen::VectorXd strain = Eigen::VectorXd::Zero(3 * n);
  for (Eigen::Index k = 0; k < n; ++k) strain[3 * k] = 1e-3 * balls[std::size_t(k)].centre_in_calibrator.x();
  return covariance + strain * strain.transpose();
}

// A tolerance of 0.1 mm is 0.75 px: it absorbs three quarters of the residuals of 0.2 px.
TEST_P(FleOf, EqualsTheNoiseOfTheImagesOnly) {
  const double sigma = 0.2, tolerance_mm = 0.1;
  const int trials = 150;
  double mean = 0, rms2 = 0;
  for (int trial = 0; trial < trials; ++trial) {
    auto views = observed_balls(sigma, std::uint64_t(trial), {0, 0.8, 1.5});
    calibration::CalibrationOptions options;
    options.rejection_probability = 0;
    const auto n = Eigen::Index(views[0].fiducials.size());
    RandomStream random(32, 0, std::uint64_t(trial));
    Eigen::VectorXd offsets(3 * n);
    for (double& offset : offsets) offset = random.normal();
    if (GetParam() == BallErrors::exact) {
      offsets *= 0;
    } else if (GetParam() == BallErrors::correlated) {
      options.common.joint_ball_covariance_mm2 = measured_covariance(views[0].fiducials);
      offsets = options.common.joint_ball_covariance_mm2.llt().matrixL() * offsets;
    } else {
      options.common.ball_covariance_mm2.assign(std::size_t(n),
                                                tolerance_mm * tolerance_mm * Eigen::Matrix3d::Identity());
      offsets *= GetParam() == BallErrors::as_stated ? tolerance_mm : 0.01 * tolerance_mm;
    }
    for (auto& view : views)
      for (Eigen::Index k = 0; k < n; ++k)
        view.fiducials[std::size_t(k)].centre_in_calibrator -= offsets.segment<3>(3 * k);
    const auto result = calibration::calibrate(views, options);
    ASSERT_TRUE(result.has_value());
    const Statistics fle = fiducial_localization_error(*result);
    ASSERT_EQ(fle.n, 36);
    mean += fle.mean / trials;
    rms2 += fle.rms * fle.rms / trials;
    for (const calibration::CalibratedView& view : result->views) {
      EXPECT_GT(view.dof, 0);
      EXPECT_LT(view.dof, 24);
    }
  }
  EXPECT_NEAR(mean / (sigma * std::sqrt(std::acos(-1) / 2)), 1, 0.04);
  EXPECT_NEAR(std::sqrt(rms2) / (sigma * std::sqrt(2.0)), 1, 0.04);
}

TEST(FiducialRegistrationError, BallsUsedInOneViewAreExcluded) {
  auto views = observed_balls(0.4, 0);
  views[0].fiducials[3].status = fiducials::FiducialStatus::occluded;
  const auto result = calibration::calibrate(views, {});
  ASSERT_TRUE(result.has_value());
  const Statistics fre = fiducial_registration_error(*result);
  EXPECT_EQ(fre.n, 11);
  EXPECT_GT(fre.rms, 0.01);
  EXPECT_LT(fre.rms, 0.2);
}

}  // namespace
}  // namespace helicarm::localization
