// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/prominent_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <unordered_map>

#include <Eigen/Geometry>

namespace helicarm::registration {
namespace prominent {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using phantom::TriangleMesh;

// Of the ball's radius: the standard deviations of the two Gaussians, how far the wider one reaches, and the
// cells by which the volume is filled. The wider one tells the tip of a round knob from its side.
constexpr double fine_share = 0.5, coarse_share = 1, reach_share = 3, cell_share = 0.2;
constexpr double gaussian_reach = 3;         // standard deviations
constexpr std::size_t columns_per_cell = 4;  // along x and y: a wall along z is placed to a tenth of a cell
constexpr double most_cells = 2e6;           // then larger ones: half a second of blurring at most
// From a cut or an open edge: the fine surroundings reach it.
constexpr double rim_share = 1.5;
constexpr double most_ball_share = 0.25, most_apart_share = 0.6;  // of the body's radius
constexpr double least_over_median = 1.5;  // an ellipsoid's equator has below 1.3 times the median

/// Points by cubic cells.
class Grid {
 public:
  explicit Grid(double cell_mm) : cell_mm_(cell_mm) {}

  void add(const Vector3d& place, std::size_t index) {
    cells_[key_of(cell_of(place))].push_back({place, index});
  }

  /// Calls `visit(index)` for every point within `radius` of the place, until it returns false.
  template <class Visit>
  bool each(const Vector3d& place, double radius, const Visit& visit) const {
    const Cell low = cell_of(place.array() - radius), high = cell_of(place.array() + radius);
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto cell = cells_.find(key_of({x, y, z}));
          if (cell == cells_.end()) continue;
          for (const auto& [at, index] : cell->second)
            if ((at - place).squaredNorm() <= radius * radius && !visit(index)) return false;
        }
    return true;
  }
  std::uint64_t key(const Vector3d& place) const { return key_of(cell_of(place)); }
  bool has_near(const Vector3d& place, double radius) const {
    return !each(place, radius, [](std::size_t) { return false; });
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  Cell cell_of(const Vector3d& place) const {
    const auto step = [&](double value) { return std::int64_t(std::floor(value / cell_mm_)); };
    return {step(place.x()), step(place.y()), step(place.z())};
  }
  /// 21 bits each; cells that share a key share their list, and distances decide.
  static std::uint64_t key_of(const Cell& cell) {
    constexpr std::uint64_t mask = (1U << 21U) - 1;
    return (std::uint64_t(cell[0]) & mask) << 42U | (std::uint64_t(cell[1]) & mask) << 21U |
           (std::uint64_t(cell[2]) & mask);
  }

  double cell_mm_;
  std::unordered_map<std::uint64_t, std::vector<std::pair<Vector3d, std::size_t>>> cells_;
};

/// The radius of the body: rms distance of its surface from the surface's middle, mm. 0: no surface.
double radius_of(const TriangleMesh& mesh) {
  double area = 0, square = 0;
  Vector3d sum = Vector3d::Zero();
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3d middle = (mesh.corners[a] + mesh.corners[b] + mesh.corners[c]) / 3;
    const double of_it =
        (mesh.corners[b] - mesh.corners[a]).cross(mesh.corners[c] - mesh.corners[a]).norm() / 2;
    area += of_it;
    sum += of_it * middle;
    square += of_it * middle.squaredNorm();
  }
  if (!(area > 0)) return 0;
  return std::sqrt(std::max(0.0, square / area - (sum / area).squaredNorm()));
}

/// How much of each cell of a grid the body fills.
class Filling {
 public:
  Filling(const TriangleMesh& mesh, double ball_mm) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& corner : mesh.corners) box.extend(corner);
    const Vector3d margin = Vector3d::Constant(reach_share * ball_mm);
    const Vector3d sizes = box.sizes() + 2 * margin;
    cell_mm_ = std::max(cell_share * ball_mm, std::cbrt(sizes.prod() / most_cells));
    // Columns meet no corner of a surface that was made on a grid.
    const Vector3d aside = cell_mm_ * Vector3d(0.137, 0.291, 0);
    low_ = box.min() - margin - aside;
    size_ = (sizes / cell_mm_).array().ceil().cast<int>() + 2;
    values_.assign(std::size_t(size_.x()) * std::size_t(size_.y()) * std::size_t(size_.z()), 0);
    fill(mesh);
    const double fine = fine_share * ball_mm / cell_mm_, coarse = coarse_share * ball_mm / cell_mm_;
    blur(fine);
    const std::vector<float> finer = values_;
    blur(std::sqrt(coarse * coarse - fine * fine));
    for (std::size_t i = 0; i < values_.size(); ++i) values_[i] = (finer[i] + values_[i]) / 2;
  }

  /// About a place within the box of the mesh: cubic between the cells' middles (Keys 1981), because the
  /// differences along a round tip are less than the error of a linear one.
  double at(const Vector3d& place) const {
    const Vector3d cells = (place - low_) / cell_mm_ - Vector3d::Constant(0.5);
    const Vector3i first = cells.array().floor().cast<int>().max(1).min(size_.array() - 3);
    std::array<std::array<double, 4>, 3> weights{};
    for (int axis = 0; axis < 3; ++axis)
      weights[std::size_t(axis)] = cubic_weights(cells[axis] - first[axis]);
    double sum = 0;
    for (int x = 0; x < 4; ++x)
      for (int y = 0; y < 4; ++y)
        for (int z = 0; z < 4; ++z)
          sum += weights[0][std::size_t(x)] * weights[1][std::size_t(y)] * weights[2][std::size_t(z)] *
                 double(values_[index(first + Vector3i(x - 1, y - 1, z - 1))]);
    return sum;
  }

 private:
  std::size_t index(const Vector3i& cell) const {
    return (std::size_t(cell.x()) * std::size_t(size_.y()) + std::size_t(cell.y())) * std::size_t(size_.z()) +
           std::size_t(cell.z());
  }

  static std::array<double, 4> cubic_weights(double t) {
    return {t * (-0.5 + t * (1 - 0.5 * t)), 1 + t * t * (-2.5 + 1.5 * t), t * (0.5 + t * (2 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t)};
  }

  /// By the heights at which the surface crosses the middles of the columns, in pairs.
  void fill(const TriangleMesh& mesh) {
    const std::size_t rows = std::size_t(size_.y()) * columns_per_cell;
    std::vector<std::vector<double>> heights(std::size_t(size_.x()) * columns_per_cell * rows);
    for (const auto& [a, b, c] : mesh.triangles)
      cross(heights, in_columns(mesh.corners[a]), in_columns(mesh.corners[b]), in_columns(mesh.corners[c]));
    constexpr double share = 1.0 / (columns_per_cell * columns_per_cell);
    for (std::size_t column = 0; column < heights.size(); ++column) {
      std::vector<double>& of_column = heights[column];
      std::ranges::sort(of_column);
      const std::size_t first =
          index(Vector3i(int(column / rows / columns_per_cell), int(column % rows / columns_per_cell), 0));
      for (std::size_t i = 0; i + 1 < of_column.size(); i += 2)
        for (int z = int(of_column[i]); z <= int(of_column[i + 1]); ++z)
          values_[first + std::size_t(z)] +=
              float(share * (std::min(of_column[i + 1], z + 1.0) - std::max(of_column[i], double(z))));
    }
  }
  /// Columns across, cells upwards.
  Vector3d in_columns(const Vector3d& place) const {
    const Vector3d cells = (place - low_) / cell_mm_;
    return {columns_per_cell * cells.x(), columns_per_cell * cells.y(), cells.z()};
  }
  void cross(std::vector<std::vector<double>>& heights, const Vector3d& a, const Vector3d& b,
             const Vector3d& c) const {
    const auto edge = [](const Vector3d& from, const Vector3d& to, double x, double y) {
      return (to.x() - from.x()) * (y - from.y()) - (to.y() - from.y()) * (x - from.x());
    };
    const double twice_area = edge(a, b, c.x(), c.y());
    if (!(std::abs(twice_area) > 0)) return;
    const auto first = [](double value) { return int(std::ceil(value - 0.5)); };
    for (int x = first(std::min({a.x(), b.x(), c.x()})); x + 0.5 <= std::max({a.x(), b.x(), c.x()}); ++x)
      for (int y = first(std::min({a.y(), b.y(), c.y()})); y + 0.5 <= std::max({a.y(), b.y(), c.y()}); ++y) {
        const double of_a = edge(b, c, x + 0.5, y + 0.5) / twice_area;
        const double of_b = edge(c, a, x + 0.5, y + 0.5) / twice_area, of_c = 1 - of_a - of_b;
        if (of_a < 0 || of_b < 0 || of_c < 0) continue;
        heights[std::size_t(x) * std::size_t(size_.y()) * columns_per_cell + std::size_t(y)].push_back(
            of_a * a.z() + of_b * b.z() + of_c * c.z());
      }
  }

  /// By a Gaussian, one axis after the other; beyond the grid nothing is filled.
  void blur(double sigma_cells) {
    const int reach = int(std::ceil(gaussian_reach * sigma_cells));
    std::vector<float> weights;
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) sum += std::exp(-0.5 * std::pow(i / sigma_cells, 2));
    for (int i = -reach; i <= reach; ++i)
      weights.push_back(float(std::exp(-0.5 * std::pow(i / sigma_cells, 2)) / sum));
    const std::array<std::size_t, 3> strides{std::size_t(size_.y()) * std::size_t(size_.z()),
                                             std::size_t(size_.z()), 1};
    std::vector<float> line;
    for (int axis = 0; axis < 3; ++axis) {
      const int p = (axis + 1) % 3, q = (axis + 2) % 3, count = size_[axis];
      const std::size_t stride = strides[std::size_t(axis)];
      for (int i = 0; i < size_[p]; ++i)
        for (int j = 0; j < size_[q]; ++j) {
          Vector3i cell = Vector3i::Zero();
          cell[p] = i, cell[q] = j;
          float* first = &values_[index(cell)];
          line.assign(std::size_t(count + 2 * reach), 0);
          for (int k = 0; k < count; ++k) line[std::size_t(k + reach)] = first[std::size_t(k) * stride];
          for (int k = 0; k < count; ++k) {
            float blurred = 0;
            for (std::size_t n = 0; n < weights.size(); ++n) blurred += weights[n] * line[std::size_t(k) + n];
            first[std::size_t(k) * stride] = blurred;
          }
        }
    }
  }

  double cell_mm_ = 0;
  Vector3d low_ = Vector3d::Zero();
  Vector3i size_ = Vector3i::Zero();
  std::vector<float> values_;
};

/// Corners of edges that have no second triangle.
std::vector<Vector3d> open_corners(const TriangleMesh& mesh) {
  std::unordered_map<std::uint64_t, int> count;
  count.reserve(2 * mesh.triangles.size());
  const auto key_of = [](std::uint32_t a, std::uint32_t b) {
    return std::uint64_t(std::min(a, b)) << 32U | std::max(a, b);
  };
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++count[key_of(triangle[i], triangle[(i + 1) % 3])];
  std::vector<Vector3d> corners;
  for (const auto& [key, uses] : count)
    if (uses == 1)
      for (const std::uint64_t corner : {key >> 32U, key & 0xffffffffU})
        corners.push_back(mesh.corners[corner]);
  return corners;
}

/// The most prominent corner of every cell: their number follows the area, not the triangles.
std::vector<ProminentPoint> leading_corners(const TriangleMesh& mesh, double ball_mm) {
  const Filling filling(mesh, ball_mm);
  const Grid cells(cell_share * ball_mm);
  std::unordered_map<std::uint64_t, ProminentPoint> leading;
  for (const Vector3d& corner : mesh.corners) {
    const ProminentPoint point{corner, 0.5 - filling.at(corner)};
    const auto [other, is_new] = leading.emplace(cells.key(corner), point);
    if (!is_new && point.prominence > other->second.prominence) other->second = point;
  }
  std::vector<ProminentPoint> points;
  points.reserve(leading.size());
  for (const auto& [cell, point] : leading) points.push_back(point);
  // In an order that does not follow from the hash.
  std::ranges::sort(points, [](const ProminentPoint& a, const ProminentPoint& b) {
    return std::make_tuple(-a.prominence, a.place.x(), a.place.y(), a.place.z()) <
           std::make_tuple(-b.prominence, b.place.x(), b.place.y(), b.place.z());
  });
  return points;
}

/// Of points by falling prominence, those that lie apart from every more prominent one and from a rim.
std::vector<ProminentPoint> local_maxima(const std::vector<ProminentPoint>& points, const Grid& rim,
                                         double ball_mm, double apart_mm) {
  Grid grid(ball_mm);
  for (std::size_t i = 0; i < points.size(); ++i) grid.add(points[i].place, i);
  const double least = std::max(0.0, least_over_median * points[points.size() / 2].prominence);
  std::vector<ProminentPoint> maxima;
  for (std::size_t i = 0; i < points.size() && points[i].prominence > least; ++i)
    if (grid.each(points[i].place, apart_mm, [&](std::size_t other) { return other >= i; }) &&
        !rim.has_near(points[i].place, rim_share * ball_mm))
      maxima.push_back(points[i]);
  return maxima;
}

double distance_from_line(const Vector3d& place, const Vector3d& a, const Vector3d& b) {
  return (place - a).cross((b - a).normalized()).norm();
}

/// The first ones that lie apart; the third beside the line of the first two if there is one.
std::vector<ProminentPoint> spread(std::vector<ProminentPoint> points, double apart_mm, std::size_t most) {
  std::vector<ProminentPoint> chosen;
  const auto is_apart = [&](const ProminentPoint& point) {
    return std::ranges::all_of(
        chosen, [&](const ProminentPoint& other) { return (other.place - point.place).norm() >= apart_mm; });
  };
  while (chosen.size() < most) {
    auto next = std::ranges::find_if(points, is_apart);
    if (next == points.end()) break;
    if (chosen.size() == 2) {
      const auto beside = std::ranges::find_if(points, [&](const ProminentPoint& point) {
        return is_apart(point) &&
               distance_from_line(point.place, chosen[0].place, chosen[1].place) >= apart_mm / 2;
      });
      if (beside != points.end()) next = beside;
    }
    chosen.push_back(*next);
    points.erase(next);
  }
  return chosen;
}

/// Without corners that no triangle has.
TriangleMesh without_loose_corners(const TriangleMesh& mesh) {
  constexpr auto unused = ~std::uint32_t(0);
  std::vector<std::uint32_t> number(mesh.corners.size(), unused);
  TriangleMesh tidy;
  tidy.triangles = mesh.triangles;
  for (auto& triangle : tidy.triangles)
    for (std::uint32_t& corner : triangle) {
      if (number[corner] == unused) {
        number[corner] = std::uint32_t(tidy.corners.size());
        tidy.corners.push_back(mesh.corners[corner]);
      }
      corner = number[corner];
    }
  return tidy;
}

std::vector<ProminentPoint> found(const TriangleMesh& given, const std::vector<Vector3d>& cuts,
                                  const ProminentOptions& options) {
  const TriangleMesh mesh = without_loose_corners(given);
  const double radius = radius_of(mesh);
  if (!(radius > 0)) return {};
  const double ball_mm = std::min(options.ball_mm, most_ball_share * radius);
  const double apart_mm = std::min(options.apart_mm, most_apart_share * radius);
  Grid rim(rim_share * ball_mm);
  for (const Vector3d& place : cuts) rim.add(place, 0);
  for (const Vector3d& place : open_corners(mesh)) rim.add(place, 0);
  return spread(local_maxima(leading_corners(mesh, ball_mm), rim, ball_mm, apart_mm), apart_mm, options.most);
}

}  // namespace
}  // namespace prominent

std::vector<ProminentPoint> prominent_points(const phantom::TriangleMesh& mesh,
                                             const std::vector<Eigen::Vector3d>& cuts,
                                             const ProminentOptions& options) {
  return prominent::found(mesh, cuts, options);
}

}  // namespace helicarm::registration
