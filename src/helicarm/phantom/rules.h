// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::phantom {

struct RuleOptions {
  double source_detector_mm = 1000;
  double source_calibrator_mm = 650;  ///< to the centroid of the balls
  double field_mm = 228.6;            ///< diameter of the receiver
  double range_deg = 5;          ///< range of rotation about both image axes in which no balls may overlap
  double target_radius_mm = 15;  ///< radius of the target region about the centroid of the balls
};

enum class Bound { at_most, at_least };

/// One design rule of 2.3.1 or 2.3.4 with the figure it is decided by.
struct RuleFinding {
  std::string rule;
  std::string sentence;
  double figure;
  Bound bound;
  double limit;
  std::string unit;
  std::string names = {};  ///< of the balls concerned, if they overlap
  bool passed() const { return bound == Bound::at_most ? figure <= limit : figure >= limit; }
};

/// All applicable rules. Those of 2.3.4 that refer to labels need balls named P1 to P12.
std::vector<RuleFinding> check_rules(const Calibrator& calibrator, const RuleOptions& options = {});

/// Views with the calibrator's centroid at the given distance from the source, the beam along +z (AP) or -y
/// (lateral, alpha = 90 degrees in Eq. 5). Pixels are mm in the detector plane, from the central ray.
struct DesignViews {
  geometry::View ap;
  geometry::View lateral;
};
DesignViews design_views(const Calibrator& calibrator, const RuleOptions& options = {});

/// Two balls and the gap between their outlines.
struct BallGap {
  std::string a, b;
  double gap_mm;
};

/// The two balls with the smallest gap between their outlines, mm at the calibrator's distance; negative if
/// they overlap. The source rotates about both image axes within `range_deg`.
BallGap smallest_gap(const Calibrator& calibrator, const geometry::View& view, double range_deg);

/// Depth of a point below the nearest face of the balls' convex hull, mm; negative outside.
double depth_in_hull_mm(const Calibrator& calibrator, const Eigen::Vector3d& point_in_calibrator);

}  // namespace helicarm::phantom
