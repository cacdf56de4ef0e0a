// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::exchange {

/// One projection of RTK's ThreeDCircularProjectionGeometry: lengths in mm, angles in degrees. The fixed
/// frame is that of IEC 61217 with the isocenter as origin; the detector's u and v are its x and y, in mm.
struct RtkProjection {
  double source_to_isocenter = 0;
  double source_to_detector = 0;
  double gantry_angle = 0;
  double out_of_plane_angle = 0;
  double in_plane_angle = 0;
  Eigen::Vector2d source_offset = Eigen::Vector2d::Zero();
  Eigen::Vector2d projection_offset = Eigen::Vector2d::Zero();

  /// From the fixed frame (mm) to homogeneous mm on the detector:
  /// T(source - projection offset) diag(-sdd, -sdd, 1 | -sid) T(-source offset) Rz(-in) Rx(-out) Ry(-gantry).
  /// The third number of an imaged point is negative.
  geometry::Projection matrix() const;
};

/// mm on the detector of the pixels: u = origin + spacing * column, v likewise with the row.
struct RtkPixels {
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();  ///< centre of the first pixel

  /// The image's centre at 0, 0.
  static RtkPixels centred(const Eigen::Vector2d& spacing_mm, const Eigen::Vector2i& image_size);
  /// From homogeneous mm to homogeneous pixels.
  Eigen::Matrix3d pixels_from_mm() const;
};

/// A view in RTK's terms, its world as the fixed frame.
struct RtkView {
  RtkProjection projection;
  RtkPixels pixels;
  /// RTK's rows run upwards where the image is not mirrored: row = height - 1 - v.
  bool rows_upwards = true;
};

/// `pixel_mm` is the pixels' height on the detector; their width follows from fx and fy. Refuses skewed
/// pixels
/// (`unsupported`) and an isocenter that is not in front of the source (`behind_source`).
Expected<RtkView> rtk_view(const geometry::View& view, const Eigen::Vector2i& image_size, double pixel_mm);

}  // namespace helicarm::exchange
