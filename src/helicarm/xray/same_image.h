// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace helicarm::xray {

/// Whether two DICOM files hold one image in different encodings: equal elements outside sequences and equal
/// pixels in every frame, whatever the transfer syntax. False if either cannot be read.
bool same_image(std::string_view file, std::string_view other);

}  // namespace helicarm::xray
