// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/volume/read_volume.h"
#include "helicarm/xray/dicom_builder.h"
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {
namespace {

xray::DicomBuilder slice(double z, const std::string& series = "2.25.7") {
  xray::DicomBuilder builder;
  builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2").text(0x00080060, "CS", "CT");
  builder.text(0x0020000E, "UI", series).text(0x00200032, "DS", fmt::format("-3\\4\\{}", z));
  builder.text(0x00200037, "DS", "1\\0\\0\\0\\1\\0").text(0x00280030, "DS", "0.5\\0.25");
  return builder.text(0x00281052, "DS", "-1000").text(0x00281053, "DS", "2");
}

/// Files in sequence, each preceded by its length.
std::string joined(const std::vector<xray::DicomBuilder>& slices) {
  std::string bytes;
  for (const xray::DicomBuilder& one : slices) {
    const std::string file = one.bytes();
    bytes += {static_cast<char>(file.size() & 0xFF), static_cast<char>(file.size() >> 8)};
    bytes += file;
  }
  return bytes;
}

}  // namespace

void run(std::string_view bytes) {
  Choices choices(bytes);
  constexpr int most_files = 6;
  const auto series = folder() / "series";
  std::filesystem::remove_all(series);
  std::filesystem::create_directories(series);
  for (int i = 0; i < most_files && !bytes.empty(); ++i) {
    const unsigned low = choices.byte();
    const std::size_t size = low + 256 * choices.byte();
    put_file(fmt::format("series/{}", i), choices.take(size));
  }
  check_volume(volume::read_volume(series));
}

std::vector<std::string> seeds() {
  return {joined({slice(12.5), slice(10), slice(15)}), joined({slice(0), slice(1), slice(3)}),
          joined({slice(0), slice(1), slice(2), slice(0, "2.25.8")}),
          joined({slice(0).text(0x00080008, "CS", "ORIGINAL\\LOCALIZER"), slice(1), slice(2)})};
}

}  // namespace helicarm::fuzz
