// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::calibration {

/// A calibration from a file, whose fiducials may be missing.
struct SavedCalibration : Calibration {
  std::vector<std::optional<rectification::DistortionMap>>
      maps;                                    ///< per view; nothing if the image was not rectified
  std::vector<phantom::CalibratorBall> balls;  ///< empty in results of earlier versions
  /// Per view, of the bones whose marker was read at its acquisition; may be empty.
  std::vector<std::map<std::string, geometry::RigidTransform>> calibrator_from_bone = {};

  /// Of a view: none where there are none.
  std::map<std::string, geometry::RigidTransform> bones_in(std::size_t view) const;
};

/// From "views" (name, projection, camera_from_calibrator, rectification.map, fiducials) and "calibration"
/// of a helicarm-result/1 or a helicarm-calibration/1. Fails with the codes of JsonReader; `bad_value` for a
/// result that was refused.
Expected<SavedCalibration> saved_calibration_from_json(const Json& json, const std::string& origin);

/// helicarm-calibration/1: those keys alone, with the fiducials' coordinates.
Json to_json(const SavedCalibration& calibration);

}  // namespace helicarm::calibration
