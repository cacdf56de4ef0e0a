// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace helicarm::image {

/// Orientation of an EXIF block, which has the structure of a TIFF file, with or without the bytes "Exif"
/// before it; nothing if it states none or is damaged.
std::optional<int> exif_orientation(std::string_view block);

/// Throws BadInput (unsupported) for an orientation of 2 to 8: pixels are those of the stored matrix, and a
/// viewer that turns them shows others. 1 is as stored; other numbers have no meaning.
void check_orientation(int orientation, const std::string& origin);

}  // namespace helicarm::image
