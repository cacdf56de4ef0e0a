// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "gui/scene/scene_values.h"

namespace helicarm::gui {

/// Viewpoint of the scene.
struct SceneCamera {
  Eigen::Vector3d position;
  Eigen::Vector3d focal_point;
  Eigen::Vector3d up;  ///< unit, across the line of sight
  double height_deg;   ///< vertical field of view

  Eigen::Vector3d forward() const { return (focal_point - position).normalized(); }
  Eigen::Vector3d right() const { return forward().cross(up).normalized(); }
  double distance() const { return (focal_point - position).norm(); }
};

/// At the view's source along its central ray, up as in the image, with the whole image in the window.
/// `aspect`: the window's width over its height. A mirrored image is shown unmirrored.
SceneCamera camera_through(const ViewShape& view, const Eigen::Vector3d& middle, double aspect);

/// Obliquely from above, with all these positions in the window.
SceneCamera overview_of(std::span<const Eigen::Vector3d> places, double aspect);

/// Rotated about the focal point: to the right and up in the image, rad.
SceneCamera turned(const SceneCamera& camera, double right_rad, double up_rad);
/// Nearer (factor > 1) or farther.
SceneCamera zoomed(const SceneCamera& camera, double factor);
/// Moves the content at the focal point right and up by fractions of the window's height.
SceneCamera shifted(const SceneCamera& camera, double right, double up);

/// Whether a link of the arm hides the content: the camera is in it, or it covers more than half of the
/// window's height nearer than the focal point.
bool obstructs(const SceneCamera& camera, const DrawnLink& link);

/// Projection of a position: x right and y up, both within [-1, 1] in the window; empty behind the camera.
std::optional<Eigen::Vector2d> seen_at(const SceneCamera& camera, double aspect,
                                       const Eigen::Vector3d& place);

}  // namespace helicarm::gui
