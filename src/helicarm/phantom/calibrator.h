// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm {

struct CalibratorBall {
  std::string label;
  Eigen::Vector3d centre_in_calibrator;  ///< mm
  double diameter_mm;
};

enum class TargetKind { ball, cross, line_end };

/// A check point of known place on the calibrator: never used to calibrate, only to measure the TRE.
struct CalibratorTarget {
  std::string name;
  Eigen::Vector3d point_in_calibrator;  ///< mm; cross: where the axes meet, line_end: centre of the flat end face
  TargetKind kind;
  double diameter_mm;                        ///< of the ball or of the wire
  std::vector<Eigen::Vector3d> directions;   ///< unit; cross: two wire axes, line_end: from the end into the wire
  double length_mm = 0;                      ///< of a wire; 0 where the file does not say
};

struct Calibrator {
  std::string name;
  std::vector<CalibratorBall> balls;
  std::vector<CalibratorTarget> targets;
};

/// The built-in calibrator: twelve 4 mm balls on the conical helix of Eq. 9 at t = pi/6 + k pi/2, k = 0..11.
Calibrator udcsc();

/// calibrator.json as docs/formats.md describes it. Refuses (bad_value) fewer than 6 balls, equal labels or places,
/// and sizes that betray a wrong unit; coplanar balls are `coplanar_fiducials`.
Expected<Calibrator> read_calibrator(const std::filesystem::path& path);

}  // namespace helicarm
