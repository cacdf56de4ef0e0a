// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// Limits within which a value from a file is believed.
inline constexpr double min_pixel_mm = 0.01, max_pixel_mm = 2;
inline constexpr double min_source_detector_mm = 200, max_source_detector_mm = 3000;

struct AcquisitionRead {
  Acquisition acquisition;  ///< without `instance_key` and `uid_key`
  std::vector<Warning> warnings;
};

/// What the tags say of how the image was taken. An absent or empty value stays absent; a senseless one is
/// bad_value. Pixel Spacing, whose plane is unknown, is never used.
Expected<AcquisitionRead> read_acquisition(const DicomElements& elements);

/// Which way the tags have the grey values run.
struct Polarity {
  bool invert;   ///< swap dark and bright, so that less dose (metal) is darker
  bool certain;  ///< false where the tags are silent or at odds: then the image may overrule them
};

/// Pixel Intensity Relationship Sign (PS3.3 C.8.11.3.1.2) says how *stored* values follow the dose: -1, more
/// is less dose, so they are inverted; +1, they are kept. MONOCHROME1 and Presentation LUT Shape INVERSE are
/// two ways to say one thing, how stored values are *shown* (C.7.6.3.1.2, C.8.11.3), and do not add to the
/// sign: with -1 the inversion is done once. Without a sign the shown values are taken, as metal is shown
/// dark on a C-arm. +1 with MONOCHROME1 (metal shown white) is right for a radiograph but also what careless
/// writers leave behind: at odds.
Expected<Polarity> read_polarity(const DicomOutline& outline);

}  // namespace helicarm
