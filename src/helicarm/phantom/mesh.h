// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace helicarm::phantom {

/// A closed surface; triangle vertices run counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> corners;  ///< mm
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Signed distance to a body's surface, mm, negative inside.
using SignedDistance = std::function<double(const Eigen::Vector3d&)>;

/// The body's surface by marching tetrahedra with the given grid step: closed, without self-intersection. The
/// body must lie inside the box, at least one step from its walls.
TriangleMesh surface_of(const SignedDistance& distance, const Eigen::AlignedBox3d& box, double step_mm);

/// mm^3.
double volume(const TriangleMesh& mesh);

/// Binary STL, little endian, coordinates in mm.
std::string to_stl(const TriangleMesh& mesh);

}  // namespace helicarm::phantom
