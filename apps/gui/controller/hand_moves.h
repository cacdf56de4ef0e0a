// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/view.h"
#include "helicarm/registration/motion.h"

/// Moves of a model by its handle, as steps from its registered pose.
namespace helicarm::gui {

/// Moved on by a shift (mm, world).
registration::RigidStep shifted(registration::RigidStep step, const Eigen::Vector3d& by_mm);
/// Turned on about the model's present centre by a rotation vector (rad, world).
registration::RigidStep turned(registration::RigidStep step, const Eigen::Vector3d& by_rad);

/// The shift across the view's rays that moves the image of `centre` as from one pixel to the other
/// (rectified).
Eigen::Vector3d shift_in_view(const geometry::View& view, const Eigen::Vector3d& centre,
                              const Eigen::Vector2d& from, const Eigen::Vector2d& to);
/// The turn about the ray through `centre` that turns the image about that of `centre` as one pixel to the
/// other; zero for a pixel at it.
Eigen::Vector3d turn_in_view(const geometry::View& view, const Eigen::Vector3d& centre,
                             const Eigen::Vector2d& from, const Eigen::Vector2d& to);

}  // namespace helicarm::gui
