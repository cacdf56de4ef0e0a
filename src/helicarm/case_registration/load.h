// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/tunnel_slices.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/registration/model.h"
#include "helicarm/registration/raster.h"

namespace helicarm::case_registration {

/// The views of a case with what its calibration found.
struct LoadedViews {
  std::vector<registration::RegistrationView> views;
  std::vector<std::optional<rectification::DistortionMap>> maps;  ///< raw to rectified; nothing: none
  Eigen::MatrixXd camera_covariance;  ///< 11 n x 11 n; empty: cameras taken as exact
  std::string patient_key;            ///< as xray::Acquisition, of the first view that has one
  std::vector<Warning> warnings;
  std::vector<Warning> inverted = {};  ///< those that are an image's `xray::XrayImage::inverted`
};

/// The views of a case: calibrated by the program, then fiducials, plate dots and check targets are masked,
/// or with cameras of other programs, then the images are taken as free of distortion. Fails as
/// `read_xray_image`, `import_matrix` and `calibrate_case`, with patient_mismatch for images of two patients,
/// and with bad_size for a camera of another image size.
Expected<LoadedViews> load_views(const pipeline::Case& the_case, const pipeline::RunOptions& run,
                                 const pipeline::Progress& progress = {});

/// The images of a case and the cameras of other programs that its views name: calibrated views without
/// covariance and fiducials. Fails as `load_views`.
Expected<pipeline::CaseCalibration> calibration_of_cameras(const pipeline::Case& the_case);

/// The views of a case that is calibrated already, or brings cameras. Of the paper's method, which has no
/// covariance, each view's follows from its residuals.
LoadedViews views_of_calibration(const pipeline::Case& the_case,
                                 const pipeline::CaseCalibration& calibration);

/// The views with the images of another moment, one for each view: their geometry, distortion and masks stay.
/// Fails with bad_size for another image size, and with patient_mismatch for another patient.
Expected<std::vector<registration::RegistrationView>> with_images(const LoadedViews& loaded,
                                                                  const std::vector<xray::XrayImage>& images);

/// What a model's files hold.
struct LoadedModel {
  std::optional<registration::Model> model;  ///< nothing: landmarks alone
  /// Of each tunnel of the plan, if there is one; nothing: the model has no outline.
  std::vector<std::optional<registration::BoneCheck>> bone_checks = {};
  std::vector<std::optional<TunnelSlices>> tunnel_slices = {};
};

/// The CT of a model that has one. Fails as `read_volume` and `tiff_stack`, and bad_value for a TIFF stack
/// without voxel_mm.
Expected<volume::Volume> volume_of(const pipeline::CaseModel& case_model);

/// 1 for each voxel of the model's CT that is of the body: by its mask, else from its window's lower limit
/// on; empty where neither is given. Fails as `load_model`.
Expected<std::vector<std::uint8_t>> body_in(const volume::Volume& ct, const pipeline::CaseModel& case_model);

/// The model's files; of a plan the tunnels against the bone.
Expected<LoadedModel> load_model(const pipeline::CaseModel& case_model,
                                 const std::optional<MarkupPlan>& plan = {});

}  // namespace helicarm::case_registration
