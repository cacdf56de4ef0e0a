// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/random_pose.h"

namespace helicarm::simulation {

using Eigen::Vector3d;

RigidTransform random_motion(RandomStream& random, double sigma_deg, double sigma_mm) {
  Vector3d spin;
  Vector3d shift;
  for (int axis = 0; axis < 3; ++axis) {
    spin[axis] = sigma_deg * EIGEN_PI / 180 * random.normal();
    shift[axis] = sigma_mm * random.normal();
  }
  const double angle = spin.norm();
  return {angle > 0 ? Eigen::AngleAxisd(angle, spin / angle).toRotationMatrix() : Eigen::Matrix3d::Identity(),
          shift};
}

Eigen::Matrix3d random_rotation(RandomStream& random) {
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = random.normal();
  return Eigen::Quaterniond(q.normalized()).toRotationMatrix();
}

}  // namespace helicarm::simulation
