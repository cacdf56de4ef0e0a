// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/image_residuals.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"

namespace helicarm::calibration {
namespace {

double squared_lengths(const CalibrationResult& result) {
  double sum = 0;
  for (const auto& view : result.image_residuals)
    for (const ImageResidual& r : view) sum += r.length_px * r.length_px;
  return sum;
}

double expected_squared_lengths(const CalibrationResult& result) {
  double sum = 0;
  for (const auto& view : result.image_residuals)
    for (const ImageResidual& r : view) sum += r.covariance_px2.trace();
  return sum;
}

TEST(ImageResiduals, OfAnExactCalibratorAreTheResidualsInTheImage) {
  RandomStream random(41, 0);
  const auto result = calibrate({observed_fiducials("AP", paper_view(0), 0.2, random)}, {});
  ASSERT_TRUE(result);
  ASSERT_EQ(result->image_residuals[0].size(), 12U);
  for (std::size_t k = 0; k < 12; ++k)
    EXPECT_NEAR(result->image_residuals[0][k].length_px, result->fiducials[0][k].residual_px, 1e-9);
  EXPECT_EQ(result->views[0].dof, 14);  // 24 - 10: no skew
  EXPECT_NEAR(degrees_of_freedom(result->image_residuals[0]), 14, 1e-6);
}

TEST(ImageResiduals, ScatterAsExpectedWithTolerancesAndCorrelatedMapErrors) {
  const double sigma = 0.2, map_sigma = 0.15, tolerance_mm = 0.05;
  const int trials = 300;
  double observed = 0, expected = 0, chi2 = 0, dof = 0;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(42, 0, std::uint64_t(trial));
    std::vector<ViewFiducials> views{
        observed_fiducials("AP", paper_view(0), sigma, random),
        observed_fiducials("LAT", paper_view(std::numbers::pi / 2), sigma, random)};
    for (ViewFiducials& view : views) {
      const Eigen::Vector2d shift = map_sigma * normal_2(random);
      for (std::size_t k = 0; k < 12; ++k) {
        view.fiducials[k].uv += (k % 2 == 0 ? 1 : -1) * shift;
        view.fiducials[k].sigma_px = std::hypot(sigma, map_sigma);
      }
      Eigen::VectorXd mode(12);
      for (Eigen::Index k = 0; k < 12; ++k) mode[k] = k % 2 == 0 ? map_sigma : -map_sigma;
      view.map_covariance_px2 = mode * mode.transpose();
    }
    for (std::size_t k = 0; k < 12; ++k) {
      const Eigen::Vector3d offset = tolerance_mm * normal_3(random);
      for (ViewFiducials& view : views) view.fiducials[k].centre_in_calibrator += offset;
    }
    CalibrationOptions options;
    options.rejection_probability = 0;
    options.common.ball_covariance_mm2.assign(12, tolerance_mm * tolerance_mm * Eigen::Matrix3d::Identity());
    const auto result = calibrate(views, options);
    ASSERT_TRUE(result);
    observed += squared_lengths(*result);
    expected += expected_squared_lengths(*result);
    for (const CalibratedView& view : result->views) {
      EXPECT_GE(view.dof, 0);
      EXPECT_LT(view.dof, 24);
      chi2 += view.chi2;
      dof += view.dof;
    }
  }
  EXPECT_NEAR(observed / expected, 1, 0.05);
  EXPECT_NEAR(chi2 / dof, 1, 0.05);
}

}  // namespace
}  // namespace helicarm::calibration
