// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/absolute_pose.h"

#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {

Eigen::Vector3d mean_of(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / double(points.size());
}

RigidTransform absolute_pose(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  const Eigen::Vector3d from_mean = mean_of(from), to_mean = mean_of(to);
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    products += (to[i] - to_mean) * (from[i] - from_mean).transpose();
  const Eigen::Matrix3d rotation = nearest_rotation(products);
  return {rotation, to_mean - rotation * from_mean};
}

}  // namespace helicarm::geometry
