// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/registration_case.h"
#include "helicarm/registration/model.h"
#include "helicarm/registration/raster.h"

namespace helicarm::case_registration {

/// The views of a case with what its calibration found.
struct LoadedViews {
  std::vector<registration::RegistrationView> views;
  std::vector<std::optional<rectification::DistortionMap>> maps;  ///< raw to rectified; nothing: none
  Eigen::MatrixXd camera_covariance;  ///< 11 n x 11 n; empty: cameras taken as exact
  std::vector<Warning> warnings;
};

/// Views with cameras of other programs; the images are taken as free of distortion. Refuses (bad_size) a
/// camera of another image size.
Expected<LoadedViews> load_views(const pipeline::RegistrationCase& given);

/// Calibrated views; fiducials, plate dots and check targets are masked.
LoadedViews load_views(const pipeline::RegistrationCase& given, const pipeline::CaseCalibration& calibration);

/// The model's files; nothing for a model of landmarks alone.
Expected<std::optional<registration::Model>> load_model(const pipeline::CaseModel& given);

}  // namespace helicarm::case_registration
