// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// Limits within which a value from a file is accepted.
inline constexpr double min_pixel_mm = 0.01, max_pixel_mm = 2;
inline constexpr double min_source_patient_mm = 50;
inline constexpr double min_source_detector_mm = 200, max_source_detector_mm = 3000;

struct AcquisitionRead {
  Acquisition acquisition;  ///< without `instance_key` and `uid_key`
  std::vector<Warning> warnings;
};

/// Acquisition parameters of a frame (0-based) from the tags. A value that is absent, empty or 0 stays
/// absent; an implausible one is bad_value. Pixel Spacing is never used: its plane is unknown. A positioner
/// angle is the run's first plus the frame's increment (PS3.3 C.8.7.5.1.3).
Expected<AcquisitionRead> read_acquisition(const DicomElements& elements, int frame, int frames);

/// Direction of the grey values according to the tags.
struct Polarity {
  bool invert;   ///< invert, so that less dose (metal) is darker
  bool certain;  ///< false if the tags are absent or inconsistent: the image content may then override them
};

/// Pixel Intensity Relationship Sign (PS3.3 C.8.11.3.1.2) relates *stored* values to the dose: -1: more is
/// less dose, invert; +1: keep. MONOCHROME1 and Presentation LUT Shape INVERSE both define how stored values
/// are *displayed* (C.7.6.3.1.2, C.8.11.3) and do not add to the sign: with -1 the inversion is done once.
/// Without a sign the displayed values are used, because C-arms display metal dark. +1 with MONOCHROME1
/// (metal displayed white) is correct for a radiograph but also a common writer error: inconsistent.
Expected<Polarity> read_polarity(const DicomOutline& outline);

}  // namespace helicarm::xray
