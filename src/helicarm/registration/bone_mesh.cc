// SPDX-License-Identifier: Apache-2.0
// The surface of a bone from a file of triangles.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "helicarm/registration/bone_surface.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

constexpr double edge_sigma_of_voxel = 0.2;  // as of a mask
constexpr double least_edge_sigma_mm = 0.1;  // of a surface that names no voxels
constexpr double bin_mm = 4, part_mm = 12;

/// The first corner of each corner's shell.
std::vector<std::uint32_t> shells(const phantom::TriangleMesh& mesh) {
  std::vector<std::uint32_t> root(mesh.corners.size());
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    root[find(b)] = find(a);
    root[find(c)] = find(a);
  }
  for (std::uint32_t i = 0; i < root.size(); ++i) root[i] = find(i);
  return root;
}

/// A ray's crossings are found among the triangles of the cells along it.
class BoneMesh final : public BoneSurface {
 public:
  BoneMesh(const Surface& surface, double voxel_mm)
      : sigma_mm_(voxel_mm > 0 ? edge_sigma_of_voxel * voxel_mm : least_edge_sigma_mm) {
    const phantom::TriangleMesh& mesh = surface.mesh;
    const auto shell = shells(mesh);
    std::vector<double> volume(mesh.corners.size(), 0);
    for (const auto& [a, b, c] : mesh.triangles)
      volume[shell[a]] += mesh.corners[a].dot(mesh.corners[b].cross(mesh.corners[c])) / 6;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const auto& [a, b, c] = mesh.triangles[i];
      if (volume[shell[a]] < 0) continue;  // the wall of a cavity
      faces_.push_back({{mesh.corners[a], mesh.corners[b], mesh.corners[c]}, surface.normals[i]});
      for (const Vector3d& corner : faces_.back().corners) box_.extend(corner);
    }
    size_ = (box_.sizes().array() / bin_mm).floor().cast<int>() + 1;
    bins_.resize(std::size_t(size_.x()) * std::size_t(size_.y()) * std::size_t(size_.z()));
    for (std::uint32_t i = 0; i < faces_.size(); ++i) {
      Eigen::AlignedBox3d box;
      for (const Vector3d& corner : faces_[i].corners) box.extend(corner);
      each_bin(box, [&](std::vector<std::uint32_t>& bin) { bin.push_back(i); });
    }
  }

  std::vector<Crossing> crossings(const Vector3d& origin, const Vector3d& direction, double length_mm,
                                  std::size_t most) const override {
    std::vector<Crossing> found;
    const int parts = std::max(1, int(std::ceil(length_mm / part_mm)));
    for (int part = 0; part < parts && found.size() < most; ++part)
      add_crossings(origin, direction, part * length_mm / parts, (part + 1) * length_mm / parts, found);
    return found;
  }

  bool holds(const Vector3d& point) const override {
    if (!box_.contains(point)) return false;
    // Off the directions along which designed surfaces have their edges.
    const Vector3d direction = Vector3d(0.5137, 0.3271, 0.7932).normalized();
    const auto found = crossings(point, direction, box_.sizes().norm(), 1);
    return !found.empty() && found.front().leaves;
  }
  bool shows(const Vector3d&) const override { return true; }
  double sigma_mm(const Vector3d&) const override { return sigma_mm_; }

 private:
  /// Of a part of the line. One through an edge meets both its faces.
  void add_crossings(const Vector3d& origin, const Vector3d& direction, double from, double to,
                     std::vector<Crossing>& found) const {
    std::vector<std::uint32_t> near;
    const int steps = std::max(1, int(std::ceil((to - from) / bin_mm)));
    const double step = (to - from) / steps;
    for (int k = 0; k < steps; ++k) {
      Eigen::AlignedBox3d box(origin + (from + k * step) * direction);
      box.extend(origin + (from + (k + 1) * step) * direction);
      if (!box.intersects(box_)) continue;
      each_bin(box, [&](const std::vector<std::uint32_t>& bin) {
        near.insert(near.end(), bin.begin(), bin.end());
      });
    }
    std::ranges::sort(near);
    near.erase(std::unique(near.begin(), near.end()), near.end());
    std::vector<Crossing> met;
    for (const std::uint32_t i : near)
      if (const auto at = at_face(faces_[i], origin, direction); at && *at >= from && *at < to)
        met.push_back({*at, faces_[i].normal, faces_[i].normal.dot(direction) > 0});
    std::ranges::sort(met, {}, &Crossing::at_mm);
    for (const Crossing& each : met)
      if (found.empty() || found.back().leaves != each.leaves) found.push_back(each);
  }

  struct Face {
    std::array<Vector3d, 3> corners;
    Vector3d normal;
  };

  /// Möller and Trumbore (1997).
  static std::optional<double> at_face(const Face& face, const Vector3d& origin, const Vector3d& direction) {
    const Vector3d a = face.corners[1] - face.corners[0], b = face.corners[2] - face.corners[0];
    const Vector3d across = direction.cross(b);
    const double area = a.dot(across);
    if (std::abs(area) < 1e-14) return std::nullopt;
    const Vector3d from = origin - face.corners[0];
    const double u = from.dot(across) / area;
    const Vector3d turned = from.cross(a);
    const double v = direction.dot(turned) / area;
    constexpr double rounding = 1e-9;
    if (u < -rounding || v < -rounding || u + v > 1 + rounding) return std::nullopt;
    return b.dot(turned) / area;
  }

  template <class Take>
  void each_bin(const Eigen::AlignedBox3d& box, const Take& take) {
    visit(*this, box, take);
  }
  template <class Take>
  void each_bin(const Eigen::AlignedBox3d& box, const Take& take) const {
    visit(*this, box, take);
  }
  template <class Self, class Take>
  static void visit(Self& self, const Eigen::AlignedBox3d& box, const Take& take) {
    const auto bin = [&](const Vector3d& at) -> Eigen::Vector3i {
      return ((at - self.box_.min()).array() / bin_mm)
          .floor()
          .cwiseMax(0)
          .cwiseMin(self.size_.template cast<double>().array() - 1)
          .template cast<int>();
    };
    const Eigen::Vector3i low = bin(box.min()), high = bin(box.max());
    for (int z = low.z(); z <= high.z(); ++z)
      for (int y = low.y(); y <= high.y(); ++y)
        for (int x = low.x(); x <= high.x(); ++x)
          take(self.bins_[std::size_t(x) +
                          std::size_t(self.size_.x()) *
                              (std::size_t(y) + std::size_t(self.size_.y()) * std::size_t(z))]);
  }

  double sigma_mm_;
  std::vector<Face> faces_;
  Eigen::AlignedBox3d box_;
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<std::vector<std::uint32_t>> bins_;
};

}  // namespace

std::shared_ptr<const BoneSurface> bone_surface(const Surface& surface, double voxel_mm) {
  return std::make_shared<const BoneMesh>(surface, voxel_mm);
}

}  // namespace helicarm::registration
