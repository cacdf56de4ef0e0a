// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pivot_calibration.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

constexpr int min_pivot_poses = 4;
/// For Gaussian errors in 3-D the median is 1.5 sigma: five times that is 7.7 sigma.
constexpr double pivot_outlier_medians = 5;
constexpr double max_pivot_outlier_share = 0.25;

/// Smallest rms rotation of a direction fixed in the tool, rad: it determines the tip's position along that
/// direction.
double least_turn(const std::vector<geometry::RigidTransform>& poses) {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (const geometry::RigidTransform& pose : poses)
    mean += pose.rotation / static_cast<double>(poses.size());
  const Eigen::Matrix3d spread = Eigen::Matrix3d::Identity() - mean.transpose() * mean;
  const double least = geometry::symmetric_eigen(spread).values[0];
  return std::asin(std::sqrt(std::clamp(least, 0.0, 1.0)));
}

struct PivotFit {
  Eigen::Matrix<double, 6, 1> tip_and_pivot = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> covariance;
  double square_sum = 0;
};

Eigen::Vector3d miss(const geometry::RigidTransform& pose, const PivotFit& fit) {
  return pose * fit.tip_and_pivot.head<3>() - fit.tip_and_pivot.tail<3>();
}

/// The rotation noise moves the tip across its lever, which is known after a first iteration.
PivotFit fit_pivot(const std::vector<geometry::RigidTransform>& poses, double sigma_mm, double sigma_rad) {
  constexpr int rounds = 3;
  PivotFit fit;
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (const geometry::RigidTransform& pose : poses) {
      const Eigen::Matrix3d lever = geometry::cross_matrix(pose.rotation * fit.tip_and_pivot.head<3>());
      const Eigen::Matrix3d covariance = sigma_mm * sigma_mm * Eigen::Matrix3d::Identity() +
                                         sigma_rad * sigma_rad * lever * lever.transpose();
      Eigen::Matrix<double, 3, 6> jacobian;
      jacobian << pose.rotation, -Eigen::Matrix3d::Identity();
      const Eigen::Matrix<double, 6, 3> weighted = jacobian.transpose() * covariance.inverse();
      information += weighted * jacobian;
      gradient -= weighted * pose.translation;
    }
    fit.covariance = geometry::inverse(information);
    fit.tip_and_pivot = fit.covariance * gradient;
    if (sigma_rad == 0) break;
  }
  for (const geometry::RigidTransform& pose : poses) fit.square_sum += miss(pose, fit).squaredNorm();
  return fit;
}

std::vector<geometry::RigidTransform> without_outliers(const std::vector<geometry::RigidTransform>& poses,
                                                       const PivotFit& fit) {
  std::vector<double> misses;
  for (const geometry::RigidTransform& pose : poses) misses.push_back(miss(pose, fit).norm());
  const double limit = pivot_outlier_medians * median(misses) + 1e-6;
  std::vector<geometry::RigidTransform> kept;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (misses[i] <= limit) kept.push_back(poses[i]);
  return kept;
}

}  // namespace

Expected<PivotCalibration> calibrate_pivot(std::span<const geometry::RigidTransform> tracker_from_tool,
                                           const PivotOptions& options) {
  constexpr double degrees_per_rad = 180 / std::numbers::pi;
  constexpr int max_rounds = 5;
  std::vector<geometry::RigidTransform> poses(tracker_from_tool.begin(), tracker_from_tool.end());
  const auto too_alike = [&](double turn_deg) {
    return fail(Reason::poses_too_alike,
                fmt::format("{} poses rotate by {:.3g} degrees rms about the direction of least rotation, at "
                            "least {} poses and {:g} degrees are required",
                            poses.size(), turn_deg, min_pivot_poses, options.min_turn_deg),
                {{"poses", static_cast<double>(poses.size())}, {"turn_deg", turn_deg}});
  };
  if (static_cast<int>(poses.size()) < min_pivot_poses) return too_alike(0);

  const bool known_noise = options.sigma_mm > 0 || options.sigma_deg > 0;
  const double sigma_mm = known_noise ? std::max(options.sigma_mm, 1e-6) : 1;
  const double sigma_rad = known_noise ? options.sigma_deg / degrees_per_rad : 0;
  PivotFit fit;
  for (int round = 0; round < max_rounds; ++round) {
    const double turn_deg = least_turn(poses) * degrees_per_rad;
    if (static_cast<int>(poses.size()) < min_pivot_poses || turn_deg < options.min_turn_deg)
      return too_alike(turn_deg);
    fit = fit_pivot(poses, sigma_mm, sigma_rad);
    auto kept = without_outliers(poses, fit);
    if (kept.size() == poses.size()) break;
    poses = std::move(kept);
  }
  PivotCalibration result;
  const double count = static_cast<double>(poses.size());
  result.tip_in_tool = fit.tip_and_pivot.head<3>();
  result.pivot_in_tracker = fit.tip_and_pivot.tail<3>();
  result.covariance = fit.covariance;
  if (!known_noise) result.covariance *= fit.square_sum / (3 * count - 6);
  result.rms_mm = std::sqrt(fit.square_sum / count);
  result.turn_deg = least_turn(poses) * degrees_per_rad;
  result.used = static_cast<int>(poses.size());
  result.outliers = static_cast<int>(tracker_from_tool.size() - poses.size());
  if (result.rms_mm > options.max_rms_mm ||
      result.outliers > max_pivot_outlier_share * static_cast<double>(tracker_from_tool.size()))
    return fail(
        Reason::residual_too_large,
        fmt::format("distance of the tip from its pivot {:.3g} mm rms, limit {:g} mm, with {} outliers of {}",
                    result.rms_mm, options.max_rms_mm, result.outliers, tracker_from_tool.size()),
        {{"rms_mm", result.rms_mm}, {"outliers", static_cast<double>(result.outliers)}});
  return result;
}

}  // namespace helicarm::tracker
