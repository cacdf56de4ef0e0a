// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/accuracy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::localization {
namespace {

const double mean_unit_length = std::sqrt(std::numbers::pi / 2);  // of a plane error, sigma 1 per axis

/// Of a normally distributed plane vector. A residual along one direction alone is shorter in the mean than
/// one of equal rms in both.
double mean_length(const Eigen::Matrix2d& covariance) {
  const Eigen::Vector2d variances = geometry::symmetric_eigen(covariance).values.cwiseMax(0);
  if (!(variances[1] > 0)) return 0;
  return std::sqrt(2 * variances[1] / std::numbers::pi) *
         std::comp_ellint_2(std::sqrt(1 - variances[0] / variances[1]));
}

}  // namespace

Statistics statistics_of(std::span<const double> errors) {
  if (errors.empty()) return {};
  Statistics s{0, 0, errors[0], errors[0], int(errors.size())};
  for (double e : errors) {
    s.mean += e / s.n;
    s.rms += e * e / s.n;
    s.max = std::max(s.max, e);
    s.min = std::min(s.min, e);
  }
  s.rms = std::sqrt(s.rms);
  return s;
}

Statistics fiducial_localization_error(const calibration::CalibrationResult& calibration) {
  constexpr double least_dof = 1;
  std::vector<double> residuals;
  double expected = 0, expected2 = 0, noise = 0, noise2 = 0, dof = 0;
  for (const auto& of_view : calibration.image_residuals)
    for (const calibration::ImageResidual& r : of_view) {
      residuals.push_back(r.length_px);
      expected += mean_length(r.covariance_px2);
      expected2 += r.covariance_px2.trace();
      noise += r.sigma_px * mean_unit_length;
      noise2 += 2 * r.sigma_px * r.sigma_px;
      dof += r.covariance_px2.trace() / (r.sigma_px * r.sigma_px);
    }
  if (dof < least_dof) return {};
  const double mean = statistics_of(residuals).mean;
  for (double& residual : residuals) residual *= std::sqrt(noise2 / expected2);
  Statistics error = statistics_of(residuals);
  error.mean = mean * noise / expected;
  return error;
}

Statistics fiducial_registration_error(const calibration::CalibrationResult& calibration) {
  std::vector<double> errors;
  calibration::Calibration exact{calibration.views, {}};
  for (calibration::CalibratedView& view : exact.views) view.reprojection_rms_px = 0;
  for (const fiducials::Fiducial& ball : calibration.fiducials.front()) {
    std::vector<PointObservation> observations;
    for (std::size_t i = 0; i < calibration.views.size(); ++i)
      for (const fiducials::Fiducial& f : calibration.fiducials[i])
        if (f.label == ball.label && f.status == fiducials::FiducialStatus::used)
          observations.push_back({i, f.uv, f.sigma_px * f.sigma_px * Eigen::Matrix2d::Identity()});
    if (const auto located = locate(ball.label, PointSource::target, observations, exact))
      errors.push_back(target_error(*located, ball.centre_in_calibrator));
  }
  return statistics_of(errors);
}

double target_error(const LocatedPoint& located, const Eigen::Vector3d& true_point) {
  return (located.point_in_anchor - true_point).norm();
}

}  // namespace helicarm::localization
