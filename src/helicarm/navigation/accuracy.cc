// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/accuracy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace helicarm {

std::optional<Statistics> statistics_of(std::span<const double> values) {
  if (values.empty()) return std::nullopt;
  Statistics s{0, 0, values[0], values[0], values.size()};
  for (double value : values) {
    s.mean += value;
    s.rms += value * value;
    s.max = std::max(s.max, value);
    s.min = std::min(s.min, value);
  }
  s.mean /= double(s.n);
  s.rms = std::sqrt(s.rms / double(s.n));
  return s;
}

std::optional<LocalizationError> estimate_localization_error(std::span<const std::vector<Fiducial>> fiducials,
                                                             std::span<const CalibratedView> views) {
  double squares = 0;
  int dof = 0;
  LocalizationError error;
  for (const auto& of_view : fiducials)
    for (const Fiducial& fiducial : of_view)
      if (fiducial.status == FiducialStatus::used) {
        squares += fiducial.residual_px * fiducial.residual_px;
        ++error.n;
      }
  for (const CalibratedView& view : views) dof += view.dof;
  if (dof <= 0) return std::nullopt;
  const double sigma = std::sqrt(squares / dof);  // per axis
  error.rms = sigma * std::numbers::sqrt2;
  error.mean = sigma * std::sqrt(std::numbers::pi / 2);  // of Rayleigh's distribution
  return error;
}

double rms_length(const Eigen::Matrix3d& covariance) { return std::sqrt(std::max(covariance.trace(), 0.0)); }

double length_at_95(const Eigen::Matrix3d& covariance) {
  constexpr double normal_at_95 = 1.6448536269514722;
  const double mean = covariance.trace();
  const double spread = covariance.squaredNorm();
  if (!(mean > 0)) return 0;
  const double w = 2 * spread / (9 * mean * mean);  // 2 / (9 degrees of freedom)
  return std::sqrt(mean * std::pow(1 - w + normal_at_95 * std::sqrt(w), 3));
}

}  // namespace helicarm
