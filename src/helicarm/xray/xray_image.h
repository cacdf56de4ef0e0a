// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"

namespace helicarm {

/// By the C-arm's own clock, which need not agree with any other.
struct AcquisitionTime {
  double seconds = 0;       ///< since 1970
  double resolution_s = 0;  ///< what is finer was cut off
  std::string source;       ///< the elements that say so; times of one source alone can be compared
};

/// What the file says of how the image was taken. Nothing is invented: absent stays absent. Flips and
/// rotation are hints; the pixels stay as stored.
struct Acquisition {
  std::optional<Eigen::Vector2d> pixel_mm;  ///< detector plane; x: column spacing, y: row spacing
  std::optional<double> source_detector_mm;
  std::optional<double> primary_angle_deg;
  std::optional<double> secondary_angle_deg;
  std::optional<AcquisitionTime> acquired;
  bool flip_hint = false;  ///< the file says that the stored image is already mirrored
  double rotation_hint_deg = 0;
  std::optional<bool> logarithmic;  ///< grey value is the logarithm of the dose, where the file says
  std::string modality;
  std::string patient_key;             ///< digest of patient ID and name: compare, never print; may be empty
  std::string study_key;               ///< digest of the study's UID; empty where the file names none
  std::string frame_of_reference_key;  ///< likewise
  std::string instance_key;            ///< digest of the pixels
  std::string uid_key;  ///< digest of SOP Instance UID and frame; empty where the file is no DICOM
};

/// One X-ray as stored. Grey values are the displayed ones: MONOCHROME1 is inverted so that metal is usually
/// dark.
struct XrayImage {
  std::string name;  ///< of the view, e.g. "AP"
  Image<float> pixels;
  float lowest = 0;  ///< least and greatest value that the file could have stored
  float highest = 4095;
  Acquisition acquisition;
  std::vector<Warning> warnings;
};

}  // namespace helicarm
