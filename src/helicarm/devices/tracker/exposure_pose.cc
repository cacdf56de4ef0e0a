// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/exposure_pose.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

/// For Gaussian errors in 3-D, 1 in 20,000 is beyond five median lengths (7.7 sigma per axis).
constexpr double outlier_medians = 5;
constexpr double max_outlier_share = 0.25;
/// With fewer samples the scatter's 21 elements are too uncertain: its two means are used.
constexpr int samples_for_full_scatter = 25;

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The sample pose with the smallest sum of distances to the others: a start robust to outliers.
geometry::RigidTransform median_pose(const std::vector<geometry::RigidTransform>& poses) {
  geometry::RigidTransform middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const geometry::RigidTransform& pose : poses) values.push_back(pose.translation[axis]);
    middle.translation[axis] = median(std::move(values));
  }
  double least = std::numeric_limits<double>::infinity();
  for (const geometry::RigidTransform& pose : poses) {
    double sum = 0;
    for (const geometry::RigidTransform& other : poses) sum += (pose.rotation - other.rotation).norm();
    if (sum < least) {
      least = sum;
      middle.rotation = pose.rotation;
    }
  }
  return middle;
}

/// Position and rotation vector of a pose relative to another.
Vector6 deviation(const geometry::RigidTransform& pose, const geometry::RigidTransform& from) {
  Vector6 d;
  d.head<3>() = pose.translation - from.translation;
  d.tail<3>() = geometry::vector_from_rotation(pose.rotation * from.rotation.transpose());
  return d;
}

std::vector<Vector6> near_ones(const std::vector<geometry::RigidTransform>& poses,
                               const geometry::RigidTransform& middle) {
  std::vector<Vector6> deviations;
  std::vector<double> lengths, angles;
  for (const geometry::RigidTransform& pose : poses) {
    deviations.push_back(deviation(pose, middle));
    lengths.push_back(deviations.back().head<3>().norm());
    angles.push_back(deviations.back().tail<3>().norm());
  }
  // Rounding to 32 bits must not make outliers of otherwise equal poses.
  const double longest = outlier_medians * median(lengths) + 1e-3;
  const double widest = outlier_medians * median(angles) + 1e-5;
  std::erase_if(deviations, [&](const Vector6& d) {
    return d.head<3>().norm() > longest || d.tail<3>().norm() > widest;
  });
  return deviations;
}

PoseCovariance scatter_of(const std::vector<Vector6>& deviations, const Vector6& mean) {
  PoseCovariance scatter = PoseCovariance::Zero();
  for (const Vector6& d : deviations) scatter += (d - mean) * (d - mean).transpose();
  scatter /= static_cast<double>(deviations.size() - 1);
  if (static_cast<int>(deviations.size()) >= samples_for_full_scatter) return scatter;
  PoseCovariance pooled = PoseCovariance::Zero();
  pooled.topLeftCorner<3, 3>().diagonal().setConstant(scatter.topLeftCorner<3, 3>().trace() / 3);
  pooled.bottomRightCorner<3, 3>().diagonal().setConstant(scatter.bottomRightCorner<3, 3>().trace() / 3);
  return pooled;
}

}  // namespace

Expected<ExposurePose> exposure_pose(std::span<const PoseSample> samples, double time_s,
                                     const ExposurePoseOptions& options) {
  if (samples.empty()) return fail(Reason::no_pose, "no pose received");
  constexpr double never = std::numeric_limits<double>::infinity();
  double before = never, after = never;
  std::vector<geometry::RigidTransform> poses;
  for (const PoseSample& sample : samples) {
    const double later = sample.time_s - time_s;
    if (later <= 0) before = std::min(before, -later);
    if (later >= 0) after = std::min(after, later);
    if (std::abs(later) <= options.window_s) poses.push_back(sample.tracker_from_tool);
  }
  std::map<std::string, double> figures{{"samples", static_cast<double>(poses.size())}};
  if (before < never) figures["before_s"] = before;
  if (after < never) figures["after_s"] = after;
  if (std::max(before, after) > options.max_gap_s)
    return fail(Reason::stale_pose,
                fmt::format("the nearest poses are {:.3g} s before and {:.3g} s after, limit {:g} s", before,
                            after, options.max_gap_s),
                figures);
  if (static_cast<int>(poses.size()) < std::max(2, options.min_samples))
    return fail(Reason::stale_pose,
                fmt::format("{} poses within the window, at least {} are required", poses.size(),
                            options.min_samples),
                figures);

  const geometry::RigidTransform middle = median_pose(poses);
  const std::vector<Vector6> kept = near_ones(poses, middle);
  const double count = static_cast<double>(kept.size());
  Vector6 mean = Vector6::Zero();
  for (const Vector6& d : kept) mean += d / count;
  double square_mm = 0, square_rad = 0;
  for (const Vector6& d : kept) {
    square_mm += (d - mean).head<3>().squaredNorm() / count;
    square_rad += (d - mean).tail<3>().squaredNorm() / count;
  }
  ExposurePose result;
  result.samples = static_cast<int>(kept.size());
  result.outliers = static_cast<int>(poses.size() - kept.size());
  result.spread_mm = std::sqrt(square_mm);
  result.spread_deg = std::sqrt(square_rad) * 180 / std::numbers::pi;
  if (result.spread_mm > options.max_spread_mm || result.spread_deg > options.max_spread_deg ||
      kept.size() < 2 || result.outliers > max_outlier_share * static_cast<double>(poses.size()))
    return fail(
        Reason::pose_spread,
        fmt::format("{} poses scatter by {:.3g} mm and {:.3g} degrees rms with {} outliers, limits {:g} mm "
                    "and {:g} degrees",
                    poses.size(), result.spread_mm, result.spread_deg, result.outliers, options.max_spread_mm,
                    options.max_spread_deg),
        {{"spread_mm", result.spread_mm},
         {"spread_deg", result.spread_deg},
         {"outliers", static_cast<double>(result.outliers)}});
  result.tracker_from_tool = {geometry::rotation_from_vector(mean.tail<3>()) * middle.rotation,
                              middle.translation + mean.head<3>()};
  result.covariance = scatter_of(kept, mean) / count;
  return result;
}

}  // namespace helicarm::tracker
