// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::python {

/// helicarm.Calibration: calibrated views, and what is known of them where it is known.
struct HeldCalibration : calibration::Calibration {
  std::vector<std::optional<rectification::DistortionMap>> maps;  ///< per view
  std::vector<std::vector<fiducials::Fiducial>> fiducials;        ///< per view; empty: not known
  std::optional<double> chi2;
  std::optional<int> dof;
  std::optional<double> variance_scale;
  std::vector<Warning> warnings;
};

}  // namespace helicarm::python
