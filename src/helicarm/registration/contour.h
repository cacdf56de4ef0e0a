// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/observation.h"
#include "helicarm/registration/raster.h"
#include "helicarm/registration/surface.h"

namespace helicarm::registration {

/// A point of the outer apparent contour.
struct ContourPoint {
  Eigen::Vector3d in_world;
  Eigen::Vector2d pixel;
  Eigen::Vector2d normal;  ///< unit, outward, in the image
};

/// The outer contour of a surface in a view, one point per cell of `spacing_px`. Empty if the source is not
/// in front of the whole surface.
std::vector<ContourPoint> apparent_contour(const Surface& surface, const geometry::View& view,
                                           const geometry::RigidTransform& world_from_model,
                                           double spacing_px);

inline constexpr double contour_spacing = 2;  ///< of the points that are compared, pixels of the raster

struct ContourOptions {
  double reach = 6;     ///< pixels of the raster, on either side, where an edge is looked for
  double sigma_px = 1;  ///< full-resolution pixels; scale of the robust weight and of the information
  /// Full-resolution pixels; most by which all edges may lie inside the contour. Over 0, of a bone: each edge
  /// is expected where the thickness of the body falls most steeply
  double inward_px = 0;
};

/// Compares the contour with the image's edges along its normals, after the offset that they have in common.
/// Agreement: the robust weight of an edge, 0 without one. Points whose edge is another line's are left out.
/// `cuts`: where the body goes on, model coordinates; its contour beside them does not count.
ViewObservation compare_contour(const Raster& raster, const geometry::View& view, const Surface& surface,
                                const geometry::RigidTransform& world_from_model,
                                const Eigen::Vector3d& centre, const ContourOptions& options,
                                const std::vector<Eigen::Vector3d>& cuts = {});

}  // namespace helicarm::registration
