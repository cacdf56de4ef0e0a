// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/hand_moves.h"

#include <cmath>

#include <Eigen/LU>

#include "helicarm/geometry/rotation.h"

namespace helicarm::gui {
namespace {

/// On the plane at depth 1, camera frame.
Eigen::Vector2d on_plane(const geometry::View& view, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d at = view.intrinsics.matrix().inverse() * pixel.homogeneous();
  return at.head<2>();
}

}  // namespace

registration::RigidStep shifted(registration::RigidStep step, const Eigen::Vector3d& by_mm) {
  step.tail<3>() += by_mm;
  return step;
}

registration::RigidStep turned(registration::RigidStep step, const Eigen::Vector3d& by_rad) {
  const Eigen::Matrix3d turn =
      geometry::rotation_from_vector(by_rad) * geometry::rotation_from_vector(step.head<3>());
  step.head<3>() = geometry::vector_from_rotation(turn);
  return step;
}

Eigen::Vector3d shift_in_view(const geometry::View& view, const Eigen::Vector3d& centre,
                              const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Eigen::Vector3d by = Eigen::Vector3d::Zero();
  by.head<2>() = view.depth(centre) * (on_plane(view, to) - on_plane(view, from));
  return view.camera_from_world.rotation.transpose() * by;
}

Eigen::Vector3d turn_in_view(const geometry::View& view, const Eigen::Vector3d& centre,
                             const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d middle = on_plane(view, view.project(centre));
  const Eigen::Vector2d a = on_plane(view, from) - middle, b = on_plane(view, to) - middle;
  if (a.isZero() || b.isZero()) return Eigen::Vector3d::Zero();
  const double angle = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  return angle * (centre - view.source_in_world()).normalized();
}

}  // namespace helicarm::gui
