// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/voxel_surface.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/statistics.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

// Femurs from masks have 13,000 to 230,000 triangles, decimated ones the fewest.
constexpr std::size_t least_voxel_triangles = 5000;
// 95th percentile of the edges' lengths, of the median: 1.4 to 2.9 of surfaces from masks, smoothed,
// decimated or of 0.6 x 0.6 x 2 mm voxels; 3.7 and 8.1 of a knee implant's.
constexpr double most_unequal = 3.2;
// Edges of a decimated surface are longer than its voxels.
constexpr double largest_voxel_mm = 1;
// Share of edges that bend by over 25 degrees: 18 to 60 % of a mask's surface, 1 to 2 % of an implant's.
constexpr double least_steps = 0.08;
const double step_cosine = std::cos(25 * EIGEN_PI / 180);
constexpr int smoothing_passes = 150;
constexpr double shrinking = 0.5, growing = -0.51;  // Taubin's lambda and mu

/// Moves every corner towards the mean of its neighbours, by that share.
void average_corners(Surface& surface, double share) {
  auto& corners = surface.mesh.corners;
  std::vector<Vector3d> sums(corners.size(), Vector3d::Zero());
  std::vector<int> counts(corners.size(), 0);
  for (const Surface::Edge& edge : surface.edges) {
    const auto [a, b] = edge.corners;
    sums[a] += corners[b], ++counts[a];
    sums[b] += corners[a], ++counts[b];
  }
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (counts[i] > 0) corners[i] += share * (sums[i] / counts[i] - corners[i]);
}

bool has_steps(const Surface& surface) {
  const auto bent = std::ranges::count_if(surface.edges, [&](const Surface::Edge& edge) {
    return surface.normals[edge.faces[0]].dot(surface.normals[edge.faces[1]]) < step_cosine;
  });
  return double(bent) > least_steps * double(surface.edges.size());
}

}  // namespace

double voxel_size_mm(const Surface& surface) {
  if (surface.mesh.triangles.size() < least_voxel_triangles) return 0;
  std::vector<double> lengths;
  for (const Surface::Edge& edge : surface.edges)
    lengths.push_back((surface.mesh.corners[edge.corners[0]] - surface.mesh.corners[edge.corners[1]]).norm());
  const double longest = quantile(lengths, 0.95);
  return longest <= most_unequal * quantile(lengths, 0.5) ? std::min(longest, largest_voxel_mm) : 0;
}

void smooth_steps(Surface& surface, double most_mm) {
  if (!has_steps(surface)) return;
  auto& corners = surface.mesh.corners;
  const std::vector<Vector3d> before = corners;
  for (int i = 0; i < smoothing_passes; ++i)
    average_corners(surface, shrinking), average_corners(surface, growing);
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (const Vector3d moved = corners[i] - before[i]; moved.norm() > most_mm)
      corners[i] = before[i] + most_mm * moved.normalized();
  for (std::size_t face = 0; face < surface.normals.size(); ++face) {
    const auto& t = surface.mesh.triangles[face];
    surface.normals[face] = (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).normalized();
  }
}

}  // namespace helicarm::registration
