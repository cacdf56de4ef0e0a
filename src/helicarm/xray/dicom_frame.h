// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/image/image.h"
#include "helicarm/xray/dicom_check.h"

namespace helicarm::xray {

/// Stored values of one frame (0-based, less than `outline.frames`); bits above Bits Stored are dropped.
/// Pixels are as stored, neither flipped nor rotated. Refuses: truncated, bad_value (damaged compressed
/// data).
Expected<image::Image<float>> decode_frame(const DicomOutline& outline, int frame);

}  // namespace helicarm::xray
