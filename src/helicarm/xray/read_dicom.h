// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "helicarm/xray/exposure.h"

namespace helicarm {

/// One frame (1-based; may be left out when there is only one) of a DICOM X-ray in memory. Checked as a whole
/// before anything is decoded; see `check_dicom`, `read_acquisition` and `read_polarity` for what is refused
/// and why.
Expected<Exposure> read_dicom(std::string_view bytes, const std::string& origin, std::optional<int> frame);

/// The 0-based frame asked for; bad_value when it does not exist, or when there are several and none was
/// named.
Expected<int> choose_frame(const std::string& origin, int frames, std::optional<int> frame);

/// Swaps dark and bright within [lowest, highest].
void invert(Exposure& exposure);

/// Inverts a picture that plainly shows bright metal, with the warning tag_disagrees.
void make_metal_dark(Exposure& exposure, const std::string& origin);

/// Digest of a picture's size and values.
std::string picture_key(const Image<float>& pixels);

}  // namespace helicarm
