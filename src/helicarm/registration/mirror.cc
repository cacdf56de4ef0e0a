// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/mirror.h"

#include <algorithm>
#include <cmath>

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

// Between a surface and its mirror image: about what edges in images resolve.
constexpr double same_shape_mm = 0.4;
// Cost ratio before the last level, beyond which the last one decides nothing.
constexpr double least_mirrored_gap = 1.5;

/// The model as its mirror image, in the plane through its centre across the world-fixed model axis x.
Model mirrored(const Model& model) {
  Eigen::Affine3d flip = Eigen::Affine3d::Identity();
  flip.linear()(0, 0) = -1;
  flip.translation().x() = 2 * model.centre.x();
  Model mirror = model;
  mirror.density.model_from_voxel = flip * model.density.model_from_voxel;
  for (auto* points : {&mirror.cuts, &mirror.samples})
    for (Vector3d& point : *points) point = flip * point;
  if (mirror.surface) {
    for (Vector3d& corner : mirror.surface->mesh.corners) corner = flip * corner;
    for (Vector3d& normal : mirror.surface->normals) normal = flip.linear() * normal;
    for (auto& triangle : mirror.surface->mesh.triangles) std::swap(triangle[1], triangle[2]);
  }
  return mirror;
}

/// Poses of the mirrored model that put it where the model is, its mirror plane turned every way: normals on
/// a spiral over half a sphere, about 10 degrees apart. Principal axes would not do: two of a condyle's are
/// alike.
std::vector<RigidTransform> mirrored_starts(const Model& model, const RigidTransform& pose) {
  constexpr int count = 200;
  const double golden_angle = EIGEN_PI * (3 - std::sqrt(5.0));
  const Eigen::Matrix3d across_x = Vector3d(-1, 1, 1).asDiagonal();
  std::vector<RigidTransform> starts;
  for (int i = 0; i < count; ++i) {
    const double z = (i + 0.5) / count, radius = std::sqrt(1 - z * z);
    const Vector3d normal(radius * std::cos(golden_angle * i), radius * std::sin(golden_angle * i), z);
    // A reflection across the normal is the one across x followed by a rotation.
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - 2 * normal * normal.transpose();
    const Eigen::Matrix3d turn = across * across_x;
    starts.push_back(pose * RigidTransform{turn, model.centre - turn * model.centre});
  }
  return starts;
}

/// The point of a triangle nearest to a point (Ericson, Real-Time Collision Detection, 5.1.5).
Vector3d nearest_in(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& point) {
  const Vector3d ab = b - a, ac = c - a, ap = point - a, bp = point - b, cp = point - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  const double of_c = d1 * d4 - d3 * d2, of_b = d5 * d2 - d1 * d6, of_a = d3 * d6 - d5 * d4;
  if (of_c <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (of_b <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  if (of_a <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  return a + (of_b * ab + of_c * ac) / (of_a + of_b + of_c);
}

/// Of the samples of `other` from the surface, each at its pose.
double root_mean_square_distance(const Surface& surface, const RigidTransform& world_from_surface,
                                 const Model& other, const RigidTransform& world_from_other) {
  const RigidTransform surface_from_other = world_from_surface.inverse() * world_from_other;
  double sum = 0;
  for (const Vector3d& sample : other.samples)
    sum += std::pow(distance(surface, surface_from_other * sample), 2);
  return std::sqrt(sum / double(other.samples.size()));
}

}  // namespace

double distance(const Surface& surface, const Vector3d& point) {
  double least = 1e300;
  for (const auto& t : surface.mesh.triangles) {
    const auto& corners = surface.mesh.corners;
    const Vector3d near = nearest_in(corners[t[0]], corners[t[1]], corners[t[2]], point);
    least = std::min(least, (near - point).squaredNorm());
  }
  return std::sqrt(least);
}

std::optional<double> mirrored_cost_ratio(const RegistrationProblem& scene, const Estimate& solution,
                                          const std::vector<SearchStage>& stages,
                                          const SearchOptions& options, double same_mm) {
  const Model mirror = mirrored(scene.model());
  RegistrationProblem other(scene, mirror);
  std::vector<SearchStage> fewer = stages;
  for (SearchStage& stage : fewer) stage.keep = std::min(stage.keep, 16);
  fewer.back().keep = 1;
  const SearchOptions less{options.shift_mm / 3, options.turn_deg / 2, 600, options.interrupt, options.share};
  const Level last = fewer.back().level;
  const bool can_end_early = fewer.size() > 1 && !scene.model().surface;
  if (can_end_early) fewer.pop_back();
  Estimate found =
      search(other, fewer, mirrored_starts(scene.model(), solution.pose), less, same_mm).solutions.front();
  if (can_end_early) {
    const Observation there = scene.observe(fewer.back().level, solution.pose, false, scene.threads());
    const double ratio = (1 - found.score) / std::max(1e-6, 1 - there.score());
    if (ratio > least_mirrored_gap) return ratio;
    other.prepare(last, solution.pose * scene.model().centre);
    found = refine(other, last, found.pose, {.iterations = 15, .threads = scene.threads()});
  }
  if (const auto& surface = scene.model().surface)
    if (root_mean_square_distance(*surface, solution.pose, mirror, found.pose) < same_shape_mm)
      return std::nullopt;
  return (1 - found.score) / std::max(1e-6, 1 - solution.score);
}

}  // namespace helicarm::registration
