// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/random_pose.h"

#include "helicarm/geometry/rotation.h"

namespace helicarm::simulation {

using Eigen::Vector3d;

geometry::RigidTransform random_motion(RandomStream& random, double sigma_deg, double sigma_mm) {
  Vector3d spin;
  Vector3d shift;
  for (int axis = 0; axis < 3; ++axis) {
    spin[axis] = sigma_deg * radian * random.normal();
    shift[axis] = sigma_mm * random.normal();
  }
  return {geometry::rotation_from_vector(spin), shift};
}

Eigen::Matrix3d random_rotation(RandomStream& random) {
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = random.normal();
  return Eigen::Quaterniond(q.normalized()).toRotationMatrix();
}

Eigen::Vector2d in_disc(RandomStream& random, double radius) {
  const double r = radius * std::sqrt(random.uniform());
  const double angle = random.uniform(0, 2 * EIGEN_PI);
  return {r * std::cos(angle), r * std::sin(angle)};
}

}  // namespace helicarm::simulation
