// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/stated_size.h"

#include <array>
#include <cstdint>
#include <fstream>

#include "helicarm/core/files.h"
#include "helicarm/image/png.h"
#include "helicarm/image/tiff.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::xray {

std::optional<Eigen::Vector2i> stated_size(const std::filesystem::path& path) {
  std::array<char, 24> head{};
  std::ifstream file(path, std::ios::binary);
  if (!file.read(head.data(), head.size())) return std::nullopt;
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(head[at + i]);
    return int(value);
  };
  if (image::is_png({head.data(), head.size()})) return Eigen::Vector2i(number(16), number(20));
  const auto bytes = read_file(path, max_image_file_bytes);
  if (!bytes) return std::nullopt;
  const std::string origin = path.filename().string();
  if (image::is_tiff(*bytes)) {
    const auto size = image::tiff_size(*bytes, origin);
    return size ? std::optional(Eigen::Vector2i((*size)[0], (*size)[1])) : std::nullopt;
  }
  const auto outline = check_dicom(*bytes, origin);
  return outline ? std::optional(Eigen::Vector2i(outline->columns, outline->rows)) : std::nullopt;
}

}  // namespace helicarm::xray
