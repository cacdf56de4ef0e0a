// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/scene.h"

#include <utility>

namespace helicarm::simulation {

Body steel(std::string name, std::vector<Solid> solids) {
  return {std::move(name), std::move(solids), material::steel, true};
}

Body moved(Body body, const geometry::RigidTransform& a_from_b) {
  for (Solid& solid : body.solids) solid = moved(solid, a_from_b);
  return body;
}

double transmission(const Scene& scene, const Eigen::Vector3d& source, const Eigen::Vector3d& direction) {
  Eigen::Array3d depth = Eigen::Array3d::Zero();
  for (const Body& body : scene) depth += body.attenuation * union_length(body.solids, source, direction);
  return (beam * (-direction.norm() * depth).exp()).sum();
}

}  // namespace helicarm::simulation
