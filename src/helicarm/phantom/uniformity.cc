// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/uniformity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

namespace helicarm::phantom {
namespace {

/// A cube and an upper bound of the distance to the nearest point within it.
struct Cell {
  Eigen::Vector3d centre;
  double half_side;
  double bound;
  bool operator<(const Cell& other) const { return bound < other.bound; }
};

double nearest_mm(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& position) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& point : points) nearest = std::min(nearest, (point - position).squaredNorm());
  return std::sqrt(nearest);
}

}  // namespace

double largest_gap_mm(const std::vector<Eigen::Vector3d>& points, const SurgicalSpace& space,
                      double tolerance_mm) {
  // Branch and bound: the distance to the nearest point is 1-Lipschitz, and moving a cell's centre to the
  // nearest point of the space does not increase its distance to any point of the space.
  double best = 0;
  std::priority_queue<Cell> open;
  const auto examine = [&](const Eigen::Vector3d& centre, double half_side) {
    const double reach = std::sqrt(3.0) * half_side;
    const Eigen::Vector3d out = centre - space.centre;
    if (out.norm() > space.radius_mm + reach) return;
    const Eigen::Vector3d inside =
        space.centre + out * std::min(1.0, space.radius_mm / std::max(out.norm(), 1e-12));
    const double distance = nearest_mm(points, inside);
    best = std::max(best, distance);
    if (distance + reach > best + tolerance_mm) open.push({centre, half_side, distance + reach});
  };
  examine(space.centre, space.radius_mm);
  while (!open.empty() && open.top().bound > best + tolerance_mm) {
    const Cell cell = open.top();
    open.pop();
    for (int octant = 0; octant < 8; ++octant) {
      const Eigen::Vector3d side(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1);
      examine(cell.centre + cell.half_side / 2 * side, cell.half_side / 2);
    }
  }
  return best;
}

double uniformity(const std::vector<Eigen::Vector3d>& points, const SurgicalSpace& space,
                  double tolerance_mm) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& point : points) mean += point / double(points.size());
  double sum = 0;
  for (const auto& point : points) sum += (point - mean).squaredNorm();
  return largest_gap_mm(points, space, tolerance_mm) /
         std::sqrt(sum / (double(points.size()) - 1));  // Eq. 13
}

}  // namespace helicarm::phantom
