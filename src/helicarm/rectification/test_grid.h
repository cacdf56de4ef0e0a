// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/detection/dot.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

struct GridError {
  double mean_px = 0;
  double max_px = 0;
};

/// The test of 3.1: crossings of a square wire grid compared with the grid defined by its nine central
/// crossings.
struct TestGrid {
  GridError raw;
  GridError rectified;
  int crosses = 0;
  double rectified_pitch_px = 0;        ///< of the ideal grid
  std::vector<Eigen::Vector2d> raw_px;  ///< the crossings on the grid
  std::vector<Eigen::Vector2d> rectified_px;
  std::vector<Eigen::Vector2d> raw_ideal_px;  ///< Eq. 14 in the raw image
  std::vector<double> raw_error_px;           ///< Eq. 15, each with its own image's similarity
  std::vector<double> rectified_error_px;
};

/// Crossings of a square wire grid; those disturbed by a plate dot are fitted at the position predicted by
/// their neighbours, with the dots' pixels masked.
std::vector<detection::Dot> find_grid(const xray::XrayImage& xray_image);

/// The crossings that define the ideal grid: the paper's nine, or all.
enum class GridFit { nine, all };

/// Least-squares similarity of the nine central crossings (Eq. 14, Umeyama 1991), then the distance of every
/// crossing from its ideal position (Eq. 15), before and after rectification. too_few_fiducials without the
/// nine.
Expected<TestGrid> measure_test_grid(const std::vector<detection::Dot>& crosses, const DistortionMap& map,
                                     GridFit fit = GridFit::nine);

/// bad_value if a grid of this pitch, 0 to 300 mm in front of the receiver, cannot have the measured one. Not
/// checked where the map has no pixel size.
Expected<void> check_pitch(const TestGrid& grid, double pitch_mm, const DistortionMap& map,
                           std::optional<double> source_detector_mm);

}  // namespace helicarm::rectification
