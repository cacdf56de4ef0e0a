// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/pipeline/result.h"
#include "helicarm/rectification/raw_path.h"

namespace helicarm::report {

/// A detected fiducial.
struct BallMark {
  std::string label;
  Eigen::Vector2d place;
  bool used = true;  ///< else rejected
  double sigma_px = 0;
  /// Observed minus projected; before the calibration by the labelling's pose, after a refusal only.
  std::optional<Eigen::Vector2d> residual = {};
};

struct DotMark {
  Eigen::Vector2d place;
  double radius_px;
};

/// A pick or a detected check target.
struct PointMark {
  std::string name;
  Eigen::Vector2d place;
  localization::PointSource source = localization::PointSource::pick;
  std::optional<double> error_95_mm = {};  ///< empty: not located
  std::string reason = {};                 ///< why it was not located
};

/// All marks of one view, as plain values in pixels.
struct ViewMarks {
  std::vector<BallMark> balls;
  std::vector<DotMark> plate_dots;
  std::vector<DotMark> false_blobs;
  std::vector<DotMark> candidates;  ///< of a view whose labelling was refused
  std::vector<BallMark> guessed;    ///< its best labels
  std::vector<PointMark> points;
  std::vector<rectification::PixelPath> tunnels;     ///< from start to end
  std::vector<rectification::PixelPath> tool_lines;  ///< extended beyond the tool's two points
};

/// Detections of a view in rectified pixels.
ViewMarks marks_of(const pipeline::Result& result, std::size_t view);

/// As above, in raw pixels. Marks outside the map's range are left out.
ViewMarks raw_marks(const ViewMarks& rectified, const rectification::DistortionMap& map);

/// Length of the largest residual of a used fiducial; 0 without any.
double largest_residual(const ViewMarks& marks);

}  // namespace helicarm::report
