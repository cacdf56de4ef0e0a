// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/tiff_scale.h"

#include <algorithm>
#include <charconv>
#include <memory>
#include <string_view>

#include <tiffio.h>

namespace helicarm::image {
namespace {

constexpr std::size_t longest_description = 10000;

/// The value of a line "KEY=VALUE".
std::string line_of(std::string_view text, std::string_view key) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = text.substr(at, end - at);
    if (line.size() > key.size() && line.starts_with(key) && line[key.size()] == '=')
      return std::string(line.substr(key.size() + 1));
    at = end + 1;
  }
  return {};
}

}  // namespace

TiffScale tiff_scale(const std::filesystem::path& path) {
  TiffScale scale;
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> file(TIFFOpen(path.c_str(), "r"), &TIFFClose);
  const char* written = nullptr;
  if (!file || !TIFFGetField(file.get(), TIFFTAG_IMAGEDESCRIPTION, &written) || !written) return scale;
  const std::string_view text = std::string_view(written).substr(0, longest_description);
  if (!text.starts_with("ImageJ=")) return scale;
  scale.unit = line_of(text, "unit");
  if (scale.unit.starts_with("\\u00B5") || scale.unit.starts_with("\\u00b5")) scale.unit = "um";
  float across = 0, down = 0;  // pixels per unit
  if (TIFFGetField(file.get(), TIFFTAG_XRESOLUTION, &across) && across > 0)
    scale.size[0] = 1 / double(across);
  if (TIFFGetField(file.get(), TIFFTAG_YRESOLUTION, &down) && down > 0) scale.size[1] = 1 / double(down);
  const std::string spacing = line_of(text, "spacing");
  double z = 0;
  if (std::from_chars(spacing.data(), spacing.data() + spacing.size(), z).ec == std::errc{})
    scale.size[2] = z;
  return scale;
}

}  // namespace helicarm::image
