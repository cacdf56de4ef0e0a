// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/image_keys.h"

#include <fmt/format.h>

#include "helicarm/core/csv.h"

namespace helicarm::track {

ImageKeys keys_of(const std::vector<xray::XrayImage>& images) {
  constexpr std::size_t digits = 16;
  ImageKeys keys;
  for (const xray::XrayImage& image : images)
    keys.push_back(image.acquisition.instance_key.substr(0, digits));
  return keys;
}

std::string image_keys_header() { return "frame,view,image\n"; }

std::string image_keys_rows(int frame, const std::vector<std::string>& views, const ImageKeys& keys) {
  std::string rows;
  for (std::size_t k = 0; k < keys.size(); ++k)
    rows += fmt::format("{},{},{}\n", frame, csv_field(views[k]), keys[k]);
  return rows;
}

std::vector<ImageKeys> image_keys_from(const std::string& text, const std::vector<std::string>& views,
                                       const std::vector<int>& frames) {
  std::vector<ImageKeys> read;
  if (!text.starts_with(image_keys_header())) return read;
  std::size_t at = image_keys_header().size();
  for (const int frame : frames) {
    ImageKeys keys;
    for (const std::string& view : views) {
      const std::size_t end = text.find('\n', at);
      const std::string begin = fmt::format("{},{},", frame, csv_field(view));
      if (end == text.npos || text.compare(at, begin.size(), begin) != 0) return read;
      keys.push_back(text.substr(at + begin.size(), end - at - begin.size()));
      at = end + 1;
    }
    read.push_back(std::move(keys));
  }
  return read;
}

std::string changed_image(int frame, const std::vector<std::string>& views, const ImageKeys& kept,
                          const ImageKeys& now) {
  for (std::size_t k = 0; k < now.size(); ++k)
    if (k >= kept.size() || kept[k] != now[k])
      return fmt::format(
          "frame {}: the image of {} is another than in the interrupted run: computed again from this frame",
          frame, views[k]);
  return "";
}

}  // namespace helicarm::track
