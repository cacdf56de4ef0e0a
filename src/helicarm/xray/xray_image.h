// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"

namespace helicarm::xray {

/// By the C-arm's own clock, which may differ from other clocks.
struct AcquisitionTime {
  double seconds = 0;       ///< since 1970
  double resolution_s = 0;  ///< finer digits were truncated
  std::string source;       ///< DICOM elements it was read from; only times of the same source are comparable
};

/// Acquisition parameters from the file; absent values stay absent. Flip and rotation are hints only: the
/// pixels stay as stored.
struct Acquisition {
  std::optional<Eigen::Vector2d> pixel_mm;  ///< detector plane; x: column spacing, y: row spacing
  std::optional<double> source_detector_mm;
  std::optional<double> source_patient_mm;  ///< to the middle of the field, as the C-arm estimates it
  std::optional<double> primary_angle_deg;
  std::optional<double> secondary_angle_deg;
  std::optional<AcquisitionTime> acquired;
  bool flip_hint = false;  ///< according to the file the stored image is already mirrored
  double rotation_hint_deg = 0;
  std::optional<bool> logarithmic;  ///< grey value is the logarithm of the dose, if the file states it
  std::string modality;
  /// Exposure, body part and orientation as in the file, by the DICOM elements' numbers.
  std::map<std::uint32_t, std::string> technique = {};
  std::string patient_key;             ///< key of patient ID and name: compare, do not print; may be empty
  std::string study_key;               ///< key of the study's UID (see text_key); empty if the file has none
  std::string frame_of_reference_key;  ///< likewise
  std::string instance_key;            ///< digest of the pixels
  std::string uid_key;                 ///< key of SOP Instance UID and frame; empty if the file is not DICOM
};

/// One X-ray image as stored. Grey values are the displayed ones: MONOCHROME1 is inverted so that metal is
/// usually dark.
struct XrayImage {
  std::string name;  ///< of the view, e.g. "AP"
  image::Image<float> pixels;
  float lowest = 0;  ///< smallest and largest value that the file can store
  float highest = 4095;
  Acquisition acquisition;
  std::vector<Warning> warnings;
  /// One of the warnings: metal looks bright, so that the reader inverted the grey values. A file that states
  /// its polarity is never inverted for its looks.
  std::optional<Warning> inverted = {};
};

}  // namespace helicarm::xray
