// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "gui/scene/scene_values.h"

namespace helicarm::gui {

/// From where the scene is looked at.
struct SceneCamera {
  Eigen::Vector3d position;
  Eigen::Vector3d focal_point;
  Eigen::Vector3d up;  ///< unit, across the line of sight
  double height_deg;   ///< angle that the view's height takes

  Eigen::Vector3d forward() const { return (focal_point - position).normalized(); }
  Eigen::Vector3d right() const { return forward().cross(up).normalized(); }
  double distance() const { return (focal_point - position).norm(); }
};

/// At the view's source along its central ray, up as in the image, all of which fits into the window.
/// `aspect`: the window's width over its height. A mirrored image is seen as it would be unmirrored.
SceneCamera camera_through(const ViewShape& view, const Eigen::Vector3d& middle, double aspect);

/// From above, obliquely, so that all these places fit.
SceneCamera overview_of(std::span<const Eigen::Vector3d> places, double aspect);

/// Turned about the focal point: to the right and up as seen in the image, rad.
SceneCamera turned(const SceneCamera& camera, double right_rad, double up_rad);
/// Nearer (factor > 1) or farther.
SceneCamera zoomed(const SceneCamera& camera, double factor);
/// What is seen at the focal point goes right and up by parts of the window's height.
SceneCamera shifted(const SceneCamera& camera, double right, double up);

/// Where a place is seen: x right and y up, both within [-1, 1] in the window; nothing behind the camera.
std::optional<Eigen::Vector2d> seen_at(const SceneCamera& camera, double aspect,
                                       const Eigen::Vector3d& place);

}  // namespace helicarm::gui
