// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace helicarm::xray {

/// What a file is that is not read as an image, with the way out, by its first bytes: "a GIF image; save it
/// as PNG". Nothing if it is not known.
std::optional<std::string> foreign_file(std::string_view bytes);

/// The container of a film by its first bytes, as ffmpeg names it: "avi", "mov". Empty if it is none.
std::string_view film_container(std::string_view bytes);

}  // namespace helicarm::xray
