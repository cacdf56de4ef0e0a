// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace helicarm::geometry {

/// Points of a plane in square cells: a search near a place takes the same time however many there are.
class NearPoints {
 public:
  /// Of finite points; quickest where searches reach about as far as `cell`, in the points' unit.
  NearPoints(std::span<const Eigen::Vector2d> points, double cell);

  /// Calls see(index, squared distance) for each point at most `reach` away.
  template <class See>
  void visit(const Eigen::Vector2d& place, double reach, See&& see) const {
    const int left = column(place.x() - reach, 0), right = column(place.x() + reach, 0);
    const int top = column(place.y() - reach, 1), bottom = column(place.y() + reach, 1);
    for (int y = top; y <= bottom; ++y)
      for (std::size_t k = starts_[cell_of(left, y)]; k < starts_[cell_of(right, y) + 1]; ++k)
        if (const double squared = (points_[members_[k]] - place).squaredNorm(); squared <= reach * reach)
          see(members_[k], squared);
  }

  /// Indices of the points at most `reach` away, ascending.
  std::vector<std::size_t> within(const Eigen::Vector2d& place, double reach) const;

  /// Indices of the `count` points next to one of them, nearest first, of equal ones the first.
  std::vector<std::size_t> nearest_to(std::size_t point, std::size_t count) const;

 private:
  int column(double coordinate, int axis) const {
    return int(std::clamp(std::floor((coordinate - low_[axis]) / size_), 0.0, double(cells_[axis] - 1)));
  }
  std::size_t cell_of(int x, int y) const {
    return std::size_t(y) * std::size_t(cells_.x()) + std::size_t(x);
  }

  std::vector<Eigen::Vector2d> points_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double size_ = 1;
  Eigen::Vector2i cells_ = Eigen::Vector2i::Ones();
  std::vector<std::size_t> starts_;   ///< of each cell in `members_`, and the end
  std::vector<std::size_t> members_;  ///< indices, cell by cell, ascending in each
};

}  // namespace helicarm::geometry
