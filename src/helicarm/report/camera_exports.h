// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/exchange/run_geometry.h"
#include "helicarm/pipeline/result.h"

/// Files of calibrated views for other programs (docs/formats.md). A view has its image and its calibration.
namespace helicarm::report {

/// MayaCam 2.0: image size, K, R, t.
std::string maya_cam(const pipeline::ViewResult& view);

/// 3 rows of 4 numbers.
std::string matrix_text(const pipeline::ViewResult& view);

/// OpenCV's FileStorage (YAML): image size, camera_matrix, no lens distortion, rvec, tvec, R.
std::string opencv_yaml(const pipeline::ViewResult& view);

/// RTK's ThreeDCircularProjectionGeometry of one projection, the calibrator's frame as the fixed one; a
/// comment states the spacing and origin of the projection image. Throws BadInput as `exchange::rtk_view`.
std::string rtk_geometry(const pipeline::ViewResult& view);

/// ITK transform whose moving space is the camera and whose fixed one is the calibrator.
std::string itk_pose(const pipeline::ViewResult& view);

/// L1 to L11, one column per view, in XMALab's pixels: u + 1 = (L1 x + L2 y + L3 z + L4) / (L9 x + L10 y +
/// L11 z + 1), height - v with L5 to L8. Throws `point_at_infinity` for a view without them.
std::string dlt_csv(std::span<const pipeline::ViewResult* const> views);

/// Calibrated views of one detector. Throws BadInput (`unsupported`) where their sizes or pixels differ.
exchange::RunGeometry run_geometry(std::span<const pipeline::ViewResult* const> views);

}  // namespace helicarm::report
