// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/rectification/distortion_map.h"
#include "module.h"

namespace helicarm::python {

using ViewKey = std::variant<std::size_t, std::string>;

/// helicarm.Calibration: calibrated views, and what is known of them where it is known.
struct HeldCalibration : calibration::SavedCalibration {
  std::vector<Warning> warnings;

  /// Raises InputError (bad_value) for another view.
  std::size_t index_of(const ViewKey& key) const;
};

/// helicarm.ViewPoints: a view's input of calibrate.
struct ViewPoints : calibration::ViewFiducials {
  std::optional<bool> mirrored;  ///< where it is known
  std::optional<rectification::DistortionMap> map;
};

/// List of {label, status, xyz_mm, uv_raw, uv, sigma_px, residual_px}.
py::list fiducial_list(const std::vector<fiducials::Fiducial>& fiducials);

/// project, locate, locate_all, predict, tre_map.
void add_point_methods(py::class_<HeldCalibration>& held);

}  // namespace helicarm::python
