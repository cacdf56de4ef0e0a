// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Grids whose axes are each other's, exchanged or reversed: voxel v of one is turn v + first of the other.
struct AxisOrder {
  Eigen::Matrix3i turn = Eigen::Matrix3i::Identity();  ///< in each row and column one 1 or -1
  Eigen::Vector3i first = Eigen::Vector3i::Zero();

  bool is_same() const { return turn.isIdentity() && first.isZero(); }
  AxisOrder inverse() const { return {turn.transpose(), -(turn.transpose() * first)}; }
  Eigen::Affine3d affine() const {
    Eigen::Affine3d all = Eigen::Affine3d::Identity();
    all.linear() = turn.cast<double>();
    all.translation() = first.cast<double>();
    return all;
  }
};

/// The order in which the axes run as nearly towards left, posterior and superior as they can.
AxisOrder order_to_patient(const Volume& volume);

/// Values of a grid in the order of another one of `to_size`, which may be larger: 0 there.
template <class Value>
std::vector<Value> reordered(const std::vector<Value>& values, const Eigen::Vector3i& size,
                             const AxisOrder& order, const Eigen::Vector3i& to_size) {
  const std::ptrdiff_t row = to_size.x(), slice = row * to_size.y();
  const auto index = [&](const Eigen::Vector3i& v) { return v.x() + row * v.y() + slice * v.z(); };
  const std::ptrdiff_t origin = index(order.first);
  const std::ptrdiff_t steps[] = {index(order.turn.col(0)), index(order.turn.col(1)),
                                  index(order.turn.col(2))};
  std::vector<Value> made(std::size_t(slice) * std::size_t(to_size.z()));
  std::size_t i = 0;
  for (int z = 0; z < size.z(); ++z)
    for (int y = 0; y < size.y(); ++y)
      for (int x = 0; x < size.x(); ++x)
        made[std::size_t(origin + x * steps[0] + y * steps[1] + z * steps[2])] = values[i++];
  return made;
}

}  // namespace helicarm::volume
