// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::guidance {

/// Two points of the instrument's axis (3.3) in the calibrator's frame, mm.
struct ToolLine {
  std::string name;
  std::string tunnel;  ///< the planned tunnel to compare with
  Eigen::Vector3d p1_in_calibrator;
  Eigen::Vector3d p2_in_calibrator;
};

/// A planned point: its position and its images.
struct PlannedPoint {
  Eigen::Vector3d point_in_calibrator;
  std::vector<std::optional<Eigen::Vector2d>> uv;  ///< rectified, one per view; nothing without a pick
};

/// Distance of a point from the instrument's line (Fig. 17).
struct LineError {
  std::vector<std::optional<double>> per_view_px;
  double combined_px = 0;  ///< Eq. 17
  double combined_mm = 0;  ///< Eq. 17 with each view's pixels converted at the point's depth
  double distance_mm = 0;  ///< in 3-D
};

/// Farthest that the axis of a drilled tunnel may pass a planned end, mm (Guo et al. 2019, section 4).
inline constexpr double most_off_plan_mm = 2;

/// How deep a drill went along its planned tunnel.
struct TipDepth {
  double beyond_end_mm;  ///< of the tip beyond the planned end, along the tunnel; negative: before it
  double sigma_mm;       ///< standard deviation: X-ray images, tracker and the drill's calibration
  double tolerance_mm;   ///< of the plan
  double error_95_mm() const;
  /// off_target beyond the tolerance, on either side of the end, as a possibility where the 95 % error
  /// exceeds the excess; uncertain within it with a 95 % error over the tolerance.
  std::optional<Failure> why_off(const std::string& tunnel) const;
};

/// "1.8 mm beyond the planned end", with the 95 % error.
std::string words_of(const TipDepth& depth);

/// A tool line compared with its tunnel; an end that is not located is absent.
struct Verification {
  std::string name;
  std::optional<LineError> start;
  std::optional<LineError> end;
  std::optional<TipDepth> depth = {};  ///< of a drill whose tip was measured
};

/// Foot of the perpendicular from `point` to the line through `a` and `b`.
Eigen::Vector2d foot_on_line(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b);

/// Eq. 17 for one point. A view along the line is left out. Refuses `behind_source` if an end of the line
/// cannot be projected.
Expected<LineError> distance_to_line(const std::vector<geometry::View>& views, const PlannedPoint& point,
                                     const ToolLine& line);

}  // namespace helicarm::guidance
