// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/jpeg_ls.h"

#include <charls/charls.h>
#include <fmt/format.h>

#include "helicarm/xray/words.h"

namespace helicarm::xray {

Expected<std::string> decode_jpeg_ls(std::string_view jpeg, int width, int height, int word_bytes,
                                     const std::string& origin) {
  const auto damaged = [&](std::string_view why) {
    return fail(Reason::bad_value, fmt::format("{}: JPEG-LS data: {}", origin, why));
  };
  try {
    charls::jpegls_decoder decoder;
    decoder.source(jpeg.data(), jpeg.size()).read_header();
    const charls::frame_info& frame = decoder.frame_info();
    if (frame.width != unsigned(width) || frame.height != unsigned(height) || frame.component_count != 1)
      return damaged(fmt::format("{} x {} pixels of {} component(s), must be {} x {} of 1", frame.width,
                                 frame.height, frame.component_count, width, height));
    if (frame.bits_per_sample > 8 * word_bytes)
      return damaged(fmt::format("{} bits a pixel, {} allocated", frame.bits_per_sample, 8 * word_bytes));
    const int bytes = frame.bits_per_sample > 8 ? 2 : 1;
    std::string out(std::size_t(width) * std::size_t(height) * std::size_t(bytes), '\0');
    decoder.decode(out.data(), out.size());
    return bytes == word_bytes ? out : widened(out);
  } catch (const charls::jpegls_error& error) {
    return damaged(error.what());
  }
}

}  // namespace helicarm::xray
