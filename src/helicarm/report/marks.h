// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/pipeline/result.h"
#include "helicarm/rectification/raw_path.h"

namespace helicarm {

/// A ball of the calibrator that was seen.
struct BallMark {
  std::string label;
  Eigen::Vector2d place;
  bool used = true;  ///< else rejected
  double sigma_px = 0;
  std::optional<Eigen::Vector2d> residual = {};  ///< observed less projected; nothing before the calibration
};

struct DotMark {
  Eigen::Vector2d place;
  double radius_px;
};

/// A pick or check target that was seen.
struct PointMark {
  std::string name;
  Eigen::Vector2d place;
  PointSource source = PointSource::pick;
  std::optional<double> error_95_mm = {};  ///< nothing: it was not located
  std::string reason = {};                 ///< why not
};

/// All there is to draw over one view, as plain values in pixels.
struct ViewMarks {
  std::vector<BallMark> balls;
  std::vector<DotMark> plate_dots;
  std::vector<DotMark> false_blobs;
  std::vector<PointMark> points;
  std::vector<PixelPath> tunnels;     ///< from start to end
  std::vector<PixelPath> tool_lines;  ///< beyond the tool's two points on both sides
};

/// What the stages found in a view, in rectified pixels.
ViewMarks marks_of(const Result& result, std::size_t view);

/// The same in raw pixels. What the map does not reach is left out.
ViewMarks raw_marks(const ViewMarks& rectified, const DistortionMap& map);

/// Length of the largest residual of a ball used; 0 where there is none.
double largest_residual(const ViewMarks& marks);

}  // namespace helicarm
