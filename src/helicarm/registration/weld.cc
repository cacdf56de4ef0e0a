// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/weld.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_map>

#include <Eigen/Geometry>

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using phantom::TriangleMesh;

/// Joins corners nearer to each other than a tolerance, by cells that are much larger than it.
class Welder {
 public:
  Welder(TriangleMesh& mesh, double tolerance) : mesh_(mesh), tolerance_(tolerance), cell_(64 * tolerance) {}

  std::uint32_t operator()(const Vector3d& place) {
    const Cell low = cell_of(place - Vector3d::Constant(tolerance_));
    const Cell high = cell_of(place + Vector3d::Constant(tolerance_));
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z)
          if (const auto found = corner_in({x, y, z}, place)) return *found;
    const auto added = static_cast<std::uint32_t>(mesh_.corners.size());
    mesh_.corners.push_back(place);
    const auto [entry, first] = last_.try_emplace(key(cell_of(place)), added);
    before_.push_back(first ? none : entry->second);
    entry->second = added;
    return added;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  static constexpr std::uint32_t none = ~0U;

  Cell cell_of(const Vector3d& place) const {
    return {std::int64_t(std::floor(place.x() / cell_)), std::int64_t(std::floor(place.y() / cell_)),
            std::int64_t(std::floor(place.z() / cell_))};
  }
  /// Cells that share a key are distinguished by the distance.
  static std::uint64_t key(const Cell& cell) {
    return std::uint64_t(cell[0]) * 73856093U ^ std::uint64_t(cell[1]) * 19349663U << 20 ^
           std::uint64_t(cell[2]) * 83492791U << 40;
  }
  std::optional<std::uint32_t> corner_in(const Cell& cell, const Vector3d& place) const {
    const auto entry = last_.find(key(cell));
    if (entry == last_.end()) return std::nullopt;
    for (std::uint32_t corner = entry->second; corner != none; corner = before_[corner])
      if ((mesh_.corners[corner] - place).cwiseAbs().maxCoeff() <= tolerance_) return corner;
    return std::nullopt;
  }

  TriangleMesh& mesh_;
  double tolerance_, cell_;
  std::unordered_map<std::uint64_t, std::uint32_t> last_;
  std::vector<std::uint32_t> before_;
};

TriangleMesh joined_within(const TriangleMesh& soup, double tolerance) {
  TriangleMesh mesh;
  Welder weld(mesh, tolerance);
  for (const auto& triangle : soup.triangles) {
    const std::uint32_t a = weld(soup.corners[triangle[0]]), b = weld(soup.corners[triangle[1]]),
                        c = weld(soup.corners[triangle[2]]);
    if (a != b && b != c && c != a) mesh.triangles.push_back({a, b, c});
  }
  return mesh;
}

std::size_t open_sides(const TriangleMesh& mesh) {
  const std::vector<FaceSide> sides = face_sides(mesh);
  const auto same = [&](std::size_t i, std::size_t k) {
    return k < sides.size() && sides[i][0] == sides[k][0] && sides[i][1] == sides[k][1];
  };
  std::size_t open = 0;
  for (std::size_t i = 0; i < sides.size(); ++i) open += !same(i, i + 1) && (i == 0 || !same(i, i - 1));
  return open;
}

}  // namespace

std::vector<FaceSide> face_sides(const TriangleMesh& mesh) {
  std::vector<FaceSide> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::uint32_t face = 0; face < mesh.triangles.size(); ++face) {
    const auto& t = mesh.triangles[face];
    for (std::size_t k = 0; k < 3; ++k)
      sides.push_back({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3]), face});
  }
  std::ranges::sort(sides);
  return sides;
}

TriangleMesh welded(const TriangleMesh& soup) {
  Eigen::AlignedBox3d box;
  for (const auto& triangle : soup.triangles)
    for (const std::uint32_t corner : triangle) box.extend(soup.corners[corner]);
  // Coordinates far from the origin are rounded more coarsely.
  const double size = soup.triangles.empty()
                          ? 1
                          : std::max({box.diagonal().norm(), box.min().cwiseAbs().maxCoeff(),
                                      box.max().cwiseAbs().maxCoeff(), 1e-6});
  TriangleMesh best;
  std::size_t fewest = ~std::size_t{0};
  for (const double part : {1e-7, 1e-6, 1e-5}) {
    TriangleMesh mesh = joined_within(soup, part * size);
    const std::size_t open = open_sides(mesh);
    if (open >= fewest) continue;
    best = std::move(mesh);
    fewest = open;
    if (open == 0) break;
  }
  return best;
}

}  // namespace helicarm::registration
