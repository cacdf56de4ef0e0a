// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// One frame (1-based; may be left out when there is only one) of a DICOM X-ray in memory. Checked as a whole
/// before anything is decoded; see `check_dicom`, `read_acquisition` and `read_polarity` for what is refused
/// and why.
Expected<XrayImage> read_dicom(std::string_view bytes, const std::string& origin, std::optional<int> frame);

/// The 0-based frame asked for; bad_value when it does not exist, or when there are several and none was
/// named.
Expected<int> choose_frame(const std::string& origin, int frames, std::optional<int> frame);

/// Swaps dark and bright within [lowest, highest].
void invert(XrayImage& xray_image);

/// Inverts an image that plainly shows bright metal, with the warning tag_disagrees.
void make_metal_dark(XrayImage& xray_image, const std::string& origin);

/// Highest grey value that the source of a 16-bit image could have stored: a source of fewer bits fills
/// either the low bits of each value or the high ones (then the low ones are zero everywhere). At least 255.
float highest_grey(const Image<float>& pixels);

/// Digest of an image's size and values.
std::string image_key(const Image<float>& pixels);

}  // namespace helicarm
