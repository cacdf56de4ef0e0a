// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// One frame (1-based; optional if the file has one) of a DICOM X-ray in memory. The whole file is checked
/// before decoding; refusals: see `check_dicom`, `read_acquisition` and `read_polarity`.
Expected<XrayImage> read_dicom(std::string_view bytes, const std::string& origin, std::optional<int> frame);

/// As `read_dicom`, of a file that `check_dicom` has checked.
Expected<XrayImage> read_dicom_frame(const DicomOutline& file, std::optional<int> frame);

/// 0-based index of the requested frame; bad_value if it does not exist, or if the file has several and none
/// is requested.
Expected<int> choose_frame(const std::string& origin, int frames, std::optional<int> frame);

/// Swaps dark and bright within [lowest, highest].
void invert(XrayImage& xray_image);

/// Inverts an image in which metal is clearly bright, with the warning tag_disagrees.
void make_metal_dark(XrayImage& xray_image, const std::string& origin);

/// Highest grey value that the source of a 16-bit image could have stored: a source of fewer bits fills
/// either the low bits of each value or the high ones (then the low ones are zero everywhere). At least 255.
float highest_grey(const image::Image<float>& pixels);

/// Digest of an image's size and values.
std::string image_key(const image::Image<float>& pixels);

}  // namespace helicarm::xray
