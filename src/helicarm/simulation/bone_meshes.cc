// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/bone_meshes.h"

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <string_view>

#include "helicarm/simulation/knee.h"

namespace helicarm::simulation {
namespace {

/// Mesh of the outer solids of these bones: a bone's first body in the scene.
phantom::TriangleMesh mesh_of(const Scene& knee, std::initializer_list<std::string_view> names,
                              double step_mm) {
  std::vector<Solid> solids;
  Eigen::AlignedBox3d box;
  for (const std::string_view name : names)
    for (const Solid& solid : std::ranges::find(knee, name, &Body::name)->solids) {
      solids.push_back(solid);
      for (const Eigen::Vector3d& corner : solid.corners()) box.extend(corner);
    }
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(2 * step_mm);
  const auto distance = [&](const Eigen::Vector3d& point) {
    double least = std::numeric_limits<double>::infinity();
    for (const Solid& solid : solids) least = std::min(least, signed_distance(solid, point));
    return least;
  };
  return phantom::surface_of(distance, {box.min() - margin, box.max() + margin}, step_mm);
}

}  // namespace

BoneMeshes bone_meshes(double step_mm) {
  const Scene knee = knee_body();
  return {mesh_of(knee, {"femur"}, step_mm), mesh_of(knee, {"tibia", "fibula", "patella"}, step_mm)};
}

BoneMeshes moved(const BoneMeshes& bones, const geometry::RigidTransform& a_from_knee) {
  BoneMeshes there = bones;
  for (phantom::TriangleMesh* mesh : {&there.femur, &there.tibia})
    for (Eigen::Vector3d& corner : mesh->corners) corner = a_from_knee * corner;
  return there;
}

}  // namespace helicarm::simulation
