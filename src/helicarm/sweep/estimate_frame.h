// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/sweep/sweep_case.h"
#include "helicarm/xray/image_file.h"

namespace helicarm::sweep {

/// What one image alone says of its camera; its pixels are not kept.
struct FrameEstimate {
  std::optional<Failure> failure;                                ///< why the frame is refused
  Eigen::Vector2i image_size{0, 0};                              ///< 0: not read
  std::optional<double> pixel_mm;                                ///< on the detector, of a rectified pixel
  std::optional<double> primary_angle_deg, secondary_angle_deg;  ///< as the file states
  std::optional<double> source_detector_mm;                      ///< likewise
  std::optional<bool> logarithmic;                               ///< whether the image is one, if it is known
  std::string image;                                             ///< digest of the pixels
  std::optional<rectification::DistortionMap> map;               ///< unless it is the identity
  std::optional<calibration::PlateMap> plate;                    ///< by its own plate
  bool map_of_record = false;                                    ///< rectified by the C-arm's record
  calibration::ViewFiducials fiducials;  ///< labelled by the evidence of this image; outliers are `rejected`
  std::optional<calibration::CalibratedView> alone;
  bool mirrored_without_statement = false;  ///< `pipeline::is_mirrored_without_statement`
  double variance_scale = 1;                ///< of the residuals over the noise model, where inconsistent
  std::vector<Warning> warnings;
};

/// Reads, rectifies, detects, labels and calibrates one image. `file`: the opened file of a run, null for a
/// file of its own. `expected`: the camera by the neighbouring images, for labels that this image alone
/// leaves open. Unreadable input (exit code 2) fails, a refusal is in the estimate.
Expected<FrameEstimate> estimate_frame(const Frame& frame, const xray::ImageFile* file,
                                       const pipeline::Case& base, const pipeline::RunOptions& options,
                                       const std::optional<fiducials::ExpectedView>& expected = {});

/// The opened file that holds the frame; null for a file of its own.
const xray::ImageFile* file_of(const Frame& frame, const SweepCase& the_case);

/// The refusal of an image with its cause, if another pixel size, source distance, shape of the pixels or
/// diameter of the balls explains it (`pipeline::with_cause`).
Failure with_cause(Failure failure, const Frame& frame, const SweepCase& the_case, unsigned threads);

/// Whether a plate or a map of the frame, or a C-arm's record, says how its image is distorted.
bool has_distortion(const Frame& frame, const SweepCase& the_case);

/// The frame's image with rectified pixels, as its camera has them. Fails as `estimate_frame`, or with why it
/// cannot be rectified.
Expected<xray::XrayImage> rectified_image_of(const Frame& frame, const SweepCase& the_case);

/// Sets `alone`, residuals and rejections of labelled fiducials, by their image alone. Fails as
/// `calibration::calibrate`.
Expected<void> calibrate_alone(FrameEstimate& estimate, const pipeline::Case& base);

/// Sets `failure`, as of `view`.
void refuse(FrameEstimate& estimate, Failure failure, const std::string& view);

/// Calibrates a frame that is not refused again with the noise of the run: `factor` times the fiducials'
/// standard deviations. Refuses it if its residuals exceed that.
void calibrate_with(double factor, const pipeline::Case& base, FrameEstimate& estimate,
                    const std::string& view);

}  // namespace helicarm::sweep
