// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::calibration {

/// A calibration read from a result file.
struct SavedCalibration : Calibration {
  std::vector<std::optional<rectification::DistortionMap>>
      maps;                                    ///< per view; nothing if the image was not rectified
  std::vector<phantom::CalibratorBall> balls;  ///< empty in results of earlier versions
};

/// From "views" (name, projection, camera_from_calibrator, rectification.map) and "calibration"
/// (joint_covariance) of a helicarm-result/1. Fails with the codes of JsonReader; `bad_value` for a result
/// that was refused.
Expected<SavedCalibration> saved_calibration_from_json(const Json& json, const std::string& origin);

}  // namespace helicarm::calibration
