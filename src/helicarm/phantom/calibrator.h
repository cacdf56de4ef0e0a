// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm::phantom {

struct CalibratorBall {
  std::string label;
  Eigen::Vector3d centre_in_calibrator;  ///< mm
  double diameter_mm;
  std::optional<Eigen::Matrix3d> covariance_mm2 = {};  ///< of a measured centre, scale error included
};

/// Covariance of several balls' centres together, scale error included.
struct JointCovariance {
  std::vector<std::string> labels;
  Eigen::MatrixXd mm2;  ///< 3n x 3n, in the order of `labels`
};

enum class TargetKind { ball, cross, line_end };

/// Check point at a known position on the calibrator: used only to measure the TRE, never for calibration.
struct CalibratorTarget {
  std::string name;
  Eigen::Vector3d
      point_in_calibrator;  ///< mm; cross: intersection of the axes, line_end: centre of the flat end face
  TargetKind kind;
  double diameter_mm;  ///< of the ball or of the wire
  std::vector<Eigen::Vector3d>
      directions;        ///< unit; cross: two wire axes, line_end: from the end into the wire
  double length_mm = 0;  ///< of a wire; 0 if not given
};

struct Calibrator {
  std::string name;
  std::vector<CalibratorBall> balls;
  std::vector<CalibratorTarget> targets;
  std::optional<JointCovariance> joint_covariance = {};  ///< of all balls, perhaps of further ones
  double tolerance_mm = 0;  ///< standard deviation of the balls' positions per axis
  double scale_sigma = 0;   ///< relative standard deviation of the common scale; 0: not stated
  Json measured = nullptr;  ///< how the file was obtained, copied verbatim
};

/// The built-in calibrator: twelve 4 mm balls on the conical helix of Eq. 9 at t = pi/6 + k pi/2, k = 0..11.
Calibrator udcsc();

/// Reads calibrator.json (docs/formats.md). Refuses (bad_value) fewer than 6 balls, equal positions,
/// directions that are not unit vectors and sizes that indicate a wrong unit; equal names are `name_clash`;
/// balls within 1 % of their spread of one plane are `coplanar_fiducials`.
Expected<Calibrator> read_calibrator(const std::filesystem::path& path);
Expected<Calibrator> calibrator_from_json(const Json& json, const std::string& origin);

/// A built-in calibrator by name, else the file of that name below `folder` (path_outside if it leads out).
Expected<Calibrator> calibrator_named(const std::string& name_or_path, const std::filesystem::path& folder);

/// Inverse of read_calibrator.
Json to_json(const Calibrator& calibrator);

/// Centroid of the balls, mm.
Eigen::Vector3d middle_of(const Calibrator& calibrator);

/// Covariance (mm^2) of each ball's centre without the scale error common to all balls: the file's covariance
/// less that of the scale about the centroid, plus the tolerance. Empty if every ball is exact.
std::vector<Eigen::Matrix3d> ball_covariances(const Calibrator& calibrator);

/// The same of all balls together (3n x 3n): the file's joint covariance, without growth about the centroid
/// where the file states `scale_sigma`, plus the tolerance. Empty if the file has none.
Eigen::MatrixXd joint_ball_covariance(const Calibrator& calibrator);

/// Same labels in any order, each ball within 0.01 mm.
bool same_places(const Calibrator& a, const Calibrator& b);

}  // namespace helicarm::phantom
