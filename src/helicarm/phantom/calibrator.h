// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm {

struct CalibratorBall {
  std::string label;
  Eigen::Vector3d centre_in_calibrator;  ///< mm
  double diameter_mm;
  std::optional<Eigen::Matrix3d> covariance_mm2 = {};  ///< of a measured centre, the scale's error included
};

enum class TargetKind { ball, cross, line_end };

/// A check point of known place on the calibrator: never used to calibrate, only to measure the TRE.
struct CalibratorTarget {
  std::string name;
  Eigen::Vector3d
      point_in_calibrator;  ///< mm; cross: where the axes meet, line_end: centre of the flat end face
  TargetKind kind;
  double diameter_mm;  ///< of the ball or of the wire
  std::vector<Eigen::Vector3d>
      directions;        ///< unit; cross: two wire axes, line_end: from the end into the wire
  double length_mm = 0;  ///< of a wire; 0 where the file does not say
};

struct Calibrator {
  std::string name;
  std::vector<CalibratorBall> balls;
  std::vector<CalibratorTarget> targets;
  double tolerance_mm = 0;  ///< of the balls' places: standard deviation per axis
  double scale_sigma = 0;   ///< relative standard deviation of all lengths together; 0: not stated
  Json measured = nullptr;  ///< how the file was obtained, as written there
};

/// The built-in calibrator: twelve 4 mm balls on the conical helix of Eq. 9 at t = pi/6 + k pi/2, k = 0..11.
Calibrator udcsc();

/// calibrator.json as docs/formats.md describes it. Refuses (bad_value) fewer than 6 balls, equal places,
/// directions that are not unit and sizes that betray a wrong unit; equal names are `name_clash`; balls
/// within 1 % of their spread of one plane are `coplanar_fiducials`.
Expected<Calibrator> read_calibrator(const std::filesystem::path& path);
Expected<Calibrator> calibrator_from_json(const Json& json, const std::string& origin);

/// A built-in by its name, else the file of that name below `folder` (path_outside where it leads out of it).
Expected<Calibrator> calibrator_named(const std::string& name_or_path, const std::filesystem::path& folder);

/// What read_calibrator reads.
Json to_json(const Calibrator& calibrator);

/// Mean place of the balls, mm.
Eigen::Vector3d middle_of(const Calibrator& calibrator);

/// Covariance (mm^2) of each ball's centre apart from the scale's error, which all balls share: the file's
/// own less that of the scale about the balls' mean, plus the tolerance. Empty where every ball is exact.
std::vector<Eigen::Matrix3d> ball_covariances(const Calibrator& calibrator);

/// The same labels in any order, each ball within 0.01 mm.
bool same_places(const Calibrator& a, const Calibrator& b);

}  // namespace helicarm
