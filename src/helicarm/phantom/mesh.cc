// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <unordered_map>

namespace helicarm::phantom {
namespace {

static_assert(std::endian::native == std::endian::little, "STL is little endian");

/// Distances of two layers of grid points, and the vertices so far, each on one grid edge.
class Marcher {
 public:
  Marcher(const SignedDistance& distance, const Eigen::AlignedBox3d& box, double step)
      : distance_(distance), low_(box.min()), step_(step) {
    count_ = (box.sizes() / step).array().ceil().cast<int>() + 1;
  }

  TriangleMesh run() {
    std::vector<double> below = layer(0);
    for (int z = 0; z + 1 < count_.z(); ++z) {
      std::vector<double> above = layer(z + 1);
      for (int y = 0; y + 1 < count_.y(); ++y)
        for (int x = 0; x + 1 < count_.x(); ++x) march_cube({x, y, z}, below, above);
      below = std::move(above);
    }
    return std::move(mesh_);
  }

 private:
  struct Vertex {
    Eigen::Vector3i index;
    double value;
  };

  Eigen::Vector3d place(const Eigen::Vector3i& index) const { return low_ + step_ * index.cast<double>(); }

  std::vector<double> layer(int z) const {
    std::vector<double> values;
    values.reserve(static_cast<std::size_t>(count_.x()) * static_cast<std::size_t>(count_.y()));
    // Kept away from zero so that no triangle degenerates in single precision.
    const double least = 0.02 * step_;
    for (int y = 0; y < count_.y(); ++y)
      for (int x = 0; x < count_.x(); ++x) {
        const double value = distance_(place({x, y, z}));
        values.push_back(std::abs(value) < least ? std::copysign(least, value) : value);
      }
    return values;
  }

  void march_cube(const Eigen::Vector3i& origin, const std::vector<double>& below,
                  const std::vector<double>& above) {
    std::array<Vertex, 8> cube;
    int inside = 0;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3i index = origin + Eigen::Vector3i(i & 1, i >> 1 & 1, i >> 2);
      const auto& values = i >> 2 ? above : below;
      cube[static_cast<std::size_t>(i)] = {
          index, values[static_cast<std::size_t>(index.y()) * static_cast<std::size_t>(count_.x()) +
                        static_cast<std::size_t>(index.x())]};
      inside += cube[static_cast<std::size_t>(i)].value < 0;
    }
    if (inside == 0 || inside == 8) return;
    // Kuhn's six tetrahedra around the diagonal 0-7; neighbouring cubes split their common face identically.
    constexpr std::size_t paths[6][2] = {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}};
    for (const auto& [a, b] : paths) march_tetrahedron({cube[0], cube[a], cube[b], cube[7]});
  }

  /// All four positively oriented: vertices 1, 2, 3 run counter-clockwise seen from 0.
  void march_tetrahedron(const std::array<Vertex, 4>& t) {
    std::array<std::size_t, 4> order{};
    std::size_t inside = 0;
    for (std::size_t i = 0; i < 4; ++i)
      if (t[i].value < 0) order[inside++] = i;
    std::size_t at = inside;
    for (std::size_t i = 0; i < 4; ++i)
      if (!(t[i].value < 0)) order[at++] = i;
    const auto cut = [&](std::size_t a, std::size_t b) { return corner(t[order[a]], t[order[b]]); };
    const bool flip = odd(order);
    if (inside == 1) add(cut(0, 1), cut(0, 2), cut(0, 3), flip);
    if (inside == 3) add(cut(3, 0), cut(3, 1), cut(3, 2), flip);
    if (inside == 2) {
      add(cut(0, 2), cut(0, 3), cut(1, 3), flip);
      add(cut(0, 2), cut(1, 3), cut(1, 2), flip);
    }
  }

  static bool odd(const std::array<std::size_t, 4>& order) {
    int swaps = 0;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j) swaps += order[j] > order[i];
    return swaps % 2 == 1;
  }

  void add(std::uint32_t a, std::uint32_t b, std::uint32_t c, bool flip) {
    if (flip) std::swap(b, c);
    mesh_.triangles.push_back({a, b, c});
  }

  std::uint32_t corner(const Vertex& a, const Vertex& b) {
    const auto number = [&](const Eigen::Vector3i& i) {
      return (static_cast<std::uint64_t>(i.z()) * static_cast<std::uint64_t>(count_.y()) +
              static_cast<std::uint64_t>(i.y())) *
                 static_cast<std::uint64_t>(count_.x()) +
             static_cast<std::uint64_t>(i.x());
    };
    const auto [first, last] = std::minmax({number(a.index), number(b.index)});
    const auto [found, fresh] =
        made_.try_emplace(first << 32 | last, static_cast<std::uint32_t>(mesh_.corners.size()));
    if (fresh) {
      const double share = a.value / (a.value - b.value);
      mesh_.corners.push_back(place(a.index) + share * (place(b.index) - place(a.index)));
    }
    return found->second;
  }

  const SignedDistance& distance_;
  Eigen::Vector3d low_;
  double step_;
  Eigen::Vector3i count_;
  TriangleMesh mesh_;
  std::unordered_map<std::uint64_t, std::uint32_t> made_;
};

template <class T>
void append(std::string& bytes, const T& value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

}  // namespace

TriangleMesh surface_of(const SignedDistance& distance, const Eigen::AlignedBox3d& box, double step_mm) {
  return Marcher(distance, box, step_mm).run();
}

double volume(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += mesh.corners[a].dot(mesh.corners[b].cross(mesh.corners[c])) / 6;
  return sum;
}

std::string to_stl(const TriangleMesh& mesh) {
  std::string bytes = "helicarm, mm";
  bytes.resize(80, ' ');
  bytes.reserve(84 + 50 * mesh.triangles.size());
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto &p = mesh.corners[a], &q = mesh.corners[b], &r = mesh.corners[c];
    const Eigen::Vector3d normal = (q - p).cross(r - p).normalized();
    for (const Eigen::Vector3d& v : {normal, p, q, r})
      for (int i = 0; i < 3; ++i) append(bytes, static_cast<float>(v[i]));
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

}  // namespace helicarm::phantom
