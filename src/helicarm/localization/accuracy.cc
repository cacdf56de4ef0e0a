// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/accuracy.h"

#include <algorithm>
#include <cmath>

namespace helicarm::localization {

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
  std::vector<double> residuals;
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const auto first = residuals.size();
    for (const fiducials::Fiducial& f : calibration.fiducials[i])
      if (f.status == fiducials::FiducialStatus::used) residuals.push_back(f.residual_px);
    const double rows = 2 * double(residuals.size() - first);
    if (calibration.views[i].dof < 1) {
      residuals.resize(first);
      continue;
    }
    for (auto r = first; r < residuals.size(); ++r)
      residuals[r] *= std::sqrt(rows / calibration.views[i].dof);
  }
  return statistics_of(residuals);
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
