// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/near_points.h"

#include <numeric>

namespace helicarm::geometry {

using Eigen::Vector2d;

NearPoints::NearPoints(std::span<const Vector2d> points, double cell)
    : points_(points.begin(), points.end()) {
  Vector2d high = Vector2d::Zero();
  if (!points_.empty()) low_ = high = points_.front();
  for (const Vector2d& point : points_) {
    low_ = low_.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  // No more cells than twice the points along either axis, whatever the reach.
  const double most = 2 * double(points_.size()) + 1, extent = (high - low_).maxCoeff();
  size_ = std::max(cell > 0 ? cell : extent, extent / most);
  if (!(size_ > 0)) size_ = 1;
  for (const int axis : {0, 1}) cells_[axis] = 1 + int((high[axis] - low_[axis]) / size_);
  if (double(cells_.x()) * double(cells_.y()) > 4 * most) {
    size_ = std::max(size_, std::sqrt((high - low_).prod() / most));
    for (const int axis : {0, 1}) cells_[axis] = 1 + int((high[axis] - low_[axis]) / size_);
  }
  starts_.assign(std::size_t(cells_.x()) * std::size_t(cells_.y()) + 1, 0);
  const auto home = [&](const Vector2d& point) {
    return cell_of(column(point.x(), 0), column(point.y(), 1));
  };
  for (const Vector2d& point : points_) ++starts_[home(point) + 1];
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
  std::vector<std::size_t> next(starts_.begin(), starts_.end() - 1);
  members_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) members_[next[home(points_[i])]++] = i;
}

std::vector<std::size_t> NearPoints::within(const Vector2d& place, double reach) const {
  std::vector<std::size_t> found;
  visit(place, reach, [&](std::size_t i, double) { found.push_back(i); });
  std::ranges::sort(found);
  return found;
}

std::vector<std::size_t> NearPoints::nearest_to(std::size_t point, std::size_t count) const {
  count = std::min(count, points_.size() - 1);
  std::vector<std::pair<double, std::size_t>> found;
  for (double reach = 2 * size_;; reach *= 2) {
    found.clear();
    visit(points_[point], reach, [&](std::size_t i, double squared) {
      if (i != point) found.emplace_back(squared, i);
    });
    if (found.size() >= count) break;
  }
  std::ranges::sort(found);
  std::vector<std::size_t> nearest;
  for (std::size_t k = 0; k < count; ++k) nearest.push_back(found[k].second);
  return nearest;
}

}  // namespace helicarm::geometry
