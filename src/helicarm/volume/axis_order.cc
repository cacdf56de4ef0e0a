// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/axis_order.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace helicarm::volume {

AxisOrder order_to_patient(const Volume& volume) {
  const Eigen::Matrix3d cosines = volume.patient_from_voxel.linear().colwise().normalized();
  std::array axes{0, 1, 2};
  double best = 0;
  AxisOrder order;
  do {
    Eigen::Matrix3i turn = Eigen::Matrix3i::Zero();
    double along = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int to = axes[std::size_t(axis)];
      along += std::abs(cosines(to, axis));
      turn(to, axis) = cosines(to, axis) < 0 ? -1 : 1;
    }
    if (along > best) best = along, order.turn = turn;
  } while (std::ranges::next_permutation(axes).found);
  const Eigen::Vector3i last = order.turn * (volume.size.array() - 1).matrix();
  order.first = (-last).cwiseMax(0);
  return order;
}

}  // namespace helicarm::volume
