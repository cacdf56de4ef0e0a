// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/simplify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <queue>
#include <tuple>
#include <vector>

#include <Eigen/LU>

namespace helicarm::phantom {
namespace {

using Triangle = std::array<std::uint32_t, 3>;
using Corners = std::array<Eigen::Vector3d, 3>;

Eigen::Vector3d normal_of(const Corners& t) { return (t[1] - t[0]).cross(t[2] - t[0]); }

double distance2_to_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a;
  return (p - a - along * std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0)).squaredNorm();
}

/// Squared distance, if it is less than `least`; otherwise `least`.
double nearer2(const Eigen::Vector3d& p, const Corners& t, const Eigen::Vector3d& unit_normal, double least) {
  const double height2 = std::pow(unit_normal.dot(p - t[0]), 2);
  if (height2 >= least) return least;
  bool above = true;
  for (std::size_t i = 0; i < 3 && above; ++i)
    above = unit_normal.cross(t[(i + 1) % 3] - t[i]).dot(p - t[i]) >= 0;
  if (above) return height2;
  return std::min({least, distance2_to_segment(p, t[0], t[1]), distance2_to_segment(p, t[1], t[2]),
                   distance2_to_segment(p, t[2], t[0])});
}

/// Sum of squared distances to planes, weighted by area: x' a x + 2 b' x + c.
struct Quadric {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double c = 0;
  double area = 0;

  void add_plane_of(const Corners& t) {
    const Eigen::Vector3d normal = normal_of(t);
    const double twice_area = normal.norm();
    if (!(twice_area > 0)) return;
    const Eigen::Vector3d unit = normal / twice_area;
    const double offset = -unit.dot(t[0]), weight = twice_area / 2;
    a += weight * unit * unit.transpose();
    b += weight * offset * unit;
    c += weight * offset * offset;
    area += weight;
  }

  Quadric& operator+=(const Quadric& other) {
    a += other.a;
    b += other.b;
    c += other.c;
    area += other.area;
    return *this;
  }

  double at(const Eigen::Vector3d& x) const { return std::max(0.0, x.dot(a * x + 2 * b) + c); }

  /// The minimum; along directions that the planes leave free, the point next to `near`.
  Eigen::Vector3d least(const Eigen::Vector3d& near) const {
    constexpr double pull = 1e-3;
    const Eigen::Matrix3d drawn = a + pull * area * Eigen::Matrix3d::Identity();
    return near - drawn.inverse() * (a * near + b);
  }
};

/// Collapse of the edge from `kept` to `removed`, as it was when the two corners had these versions.
struct Collapse {
  double cost;
  std::uint32_t kept, removed;
  std::uint32_t versions;
  Eigen::Vector3d position;

  bool operator<(const Collapse& other) const {
    return std::tie(other.cost, other.kept, other.removed) < std::tie(cost, kept, removed);
  }
};

class Simplifier {
 public:
  Simplifier(const TriangleMesh& mesh, double tolerance)
      : tolerance2_(tolerance * tolerance),
        given_(mesh.corners),
        corners_(mesh.corners),
        triangles_(mesh.triangles),
        held_(mesh.triangles.size()),
        alive_(mesh.triangles.size(), true),
        around_(mesh.corners.size()),
        quadrics_(mesh.corners.size()),
        versions_(mesh.corners.size(), 0) {
    for (std::uint32_t i = 0; i < triangles_.size(); ++i)
      for (const std::uint32_t corner : triangles_[i]) {
        around_[corner].push_back(i);
        quadrics_[corner].add_plane_of(corners_of(triangles_[i]));
      }
    // A corner within a plane is near the result if the plane's border is.
    for (std::uint32_t i = 0; i < corners_.size(); ++i)
      if (!around_[i].empty() && !is_flat(i)) held_[around_[i].front()].push_back(i);
    for (const Triangle& t : triangles_)
      for (std::size_t k = 0; k < 3; ++k)
        if (t[k] < t[(k + 1) % 3]) push(t[k], t[(k + 1) % 3]);
  }

  TriangleMesh run() {
    while (!queue_.empty()) {
      const Collapse next = queue_.top();
      queue_.pop();
      if (next.versions == versions_[next.kept] + versions_[next.removed] && !around_[next.removed].empty() &&
          !around_[next.kept].empty())
        collapse(next);
    }
    return result();
  }

 private:
  Corners corners_of(const Triangle& t) const { return {corners_[t[0]], corners_[t[1]], corners_[t[2]]}; }

  bool is_flat(std::uint32_t corner) const {
    constexpr double flat_cosine = 1 - 1e-6;
    const Eigen::Vector3d first = normal_of(corners_of(triangles_[around_[corner].front()])).normalized();
    return std::ranges::all_of(around_[corner], [&](std::uint32_t face) {
      return normal_of(corners_of(triangles_[face])).normalized().dot(first) > flat_cosine;
    });
  }

  void push(std::uint32_t i, std::uint32_t j) {
    Quadric sum = quadrics_[i];
    sum += quadrics_[j];
    const Eigen::Vector3d position = sum.least((corners_[i] + corners_[j]) / 2);
    if (sum.at(position) <= tolerance2_ * sum.area)
      queue_.push({sum.at(position), i, j, versions_[i] + versions_[j], position});
  }

  std::vector<std::uint32_t> neighbours(std::uint32_t corner) const {
    std::vector<std::uint32_t> found;
    for (const std::uint32_t face : around_[corner])
      for (const std::uint32_t other : triangles_[face])
        if (other != corner) found.push_back(other);
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  /// Otherwise the collapse would pinch the surface (link condition).
  bool stays_a_surface(std::uint32_t i, std::uint32_t j) const {
    const auto of_i = neighbours(i), of_j = neighbours(j);
    std::vector<std::uint32_t> common;
    std::ranges::set_intersection(of_i, of_j, std::back_inserter(common));
    return common.size() == 2 && of_i.size() + of_j.size() > 7;
  }

  struct Fan {
    std::vector<std::uint32_t> removed, kept;  ///< triangles about the edge
    std::vector<Corners> after;                ///< of the kept ones
    std::vector<Eigen::Vector3d> normals;      ///< after it, units
    std::vector<std::vector<std::uint32_t>> held;
  };

  /// The triangles about an edge after its collapse. Nothing if one of them would turn over or vanish, or a
  /// corner of the given mesh would be too far away.
  std::optional<Fan> fan_of(const Collapse& c) const {
    Fan fan;
    std::vector<std::uint32_t> homeless;
    for (const std::uint32_t end : {c.kept, c.removed})
      for (const std::uint32_t face : around_[end]) {
        const Triangle& t = triangles_[face];
        const bool shared = std::ranges::count(t, c.kept) + std::ranges::count(t, c.removed) == 2;
        if (shared && end == c.removed) continue;
        homeless.insert(homeless.end(), held_[face].begin(), held_[face].end());
        if (shared) {
          fan.removed.push_back(face);
          continue;
        }
        Corners after = corners_of(t);
        for (std::size_t k = 0; k < 3; ++k)
          if (t[k] == end) after[k] = c.position;
        const Eigen::Vector3d before = normal_of(corners_of(t)), now = normal_of(after);
        constexpr double least_cosine = 0.5, least_twice_area_mm2 = 1e-4;
        const double size = now.norm();
        if (size < least_twice_area_mm2 || now.dot(before) < least_cosine * size * before.norm())
          return std::nullopt;
        fan.kept.push_back(face);
        fan.after.push_back(after);
        fan.normals.push_back(now / size);
      }
    fan.held.resize(fan.kept.size());
    constexpr double near_enough = 1e-4;  // of the squared tolerance: no nearer triangle is looked for
    for (const std::uint32_t corner : homeless) {
      std::size_t nearest = fan.after.size();
      double least = tolerance2_;
      for (std::size_t i = 0; i < fan.after.size() && least > near_enough * tolerance2_; ++i)
        if (const double d2 = nearer2(given_[corner], fan.after[i], fan.normals[i], least); d2 < least) {
          least = d2;
          nearest = i;
        }
      if (nearest == fan.after.size()) return std::nullopt;
      fan.held[nearest].push_back(corner);
    }
    return fan;
  }

  void collapse(const Collapse& c) {
    if (!stays_a_surface(c.kept, c.removed)) return;
    auto fan = fan_of(c);
    if (!fan) return;
    for (const std::uint32_t face : fan->removed) {
      alive_[face] = false;
      for (const std::uint32_t corner : triangles_[face]) std::erase(around_[corner], face);
    }
    for (std::size_t i = 0; i < fan->kept.size(); ++i) held_[fan->kept[i]] = std::move(fan->held[i]);
    for (const std::uint32_t face : around_[c.removed]) {
      std::ranges::replace(triangles_[face], c.removed, c.kept);
      around_[c.kept].push_back(face);
    }
    around_[c.removed].clear();
    corners_[c.kept] = c.position;
    quadrics_[c.kept] += quadrics_[c.removed];
    ++versions_[c.kept];
    for (const std::uint32_t other : neighbours(c.kept)) push(c.kept, other);
  }

  TriangleMesh result() const {
    TriangleMesh mesh;
    std::vector<std::uint32_t> number(corners_.size());
    for (std::size_t i = 0; i < corners_.size(); ++i)
      if (!around_[i].empty()) {
        number[i] = static_cast<std::uint32_t>(mesh.corners.size());
        mesh.corners.push_back(corners_[i]);
      }
    for (std::size_t i = 0; i < triangles_.size(); ++i)
      if (alive_[i])
        mesh.triangles.push_back(
            {number[triangles_[i][0]], number[triangles_[i][1]], number[triangles_[i][2]]});
    return mesh;
  }

  double tolerance2_;
  const std::vector<Eigen::Vector3d>& given_;
  std::vector<Eigen::Vector3d> corners_;
  std::vector<Triangle> triangles_;
  std::vector<std::vector<std::uint32_t>>
      held_;  ///< given corners out of flat parts, each by a triangle near it
  std::vector<bool> alive_;
  std::vector<std::vector<std::uint32_t>> around_;  ///< triangles about each corner
  std::vector<Quadric> quadrics_;
  std::vector<std::uint32_t> versions_;
  std::priority_queue<Collapse> queue_;
};

}  // namespace

TriangleMesh simplified(const TriangleMesh& mesh, double tolerance_mm) {
  return Simplifier(mesh, tolerance_mm).run();
}

}  // namespace helicarm::phantom
