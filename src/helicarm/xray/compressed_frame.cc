// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/compressed_frame.h"

#include "helicarm/xray/jpeg.h"
#include "helicarm/xray/jpeg_2000.h"
#include "helicarm/xray/jpeg_ls.h"
#include "helicarm/xray/rle.h"

namespace helicarm::xray {

Expected<std::string> decode_compressed(std::string bytes, Coding coding, const Eigen::Vector2i& size,
                                        int word_bytes, const std::string& origin) {
  if (bytes.empty()) return fail(Reason::truncated, origin + ": Pixel Data (7FE0,0010) has an empty frame");
  switch (coding) {
    case Coding::rle:
      return decode_rle(bytes, std::size_t(size.x()) * std::size_t(size.y()), word_bytes, origin);
    case Coding::jpeg_ls:
      return decode_jpeg_ls(bytes, size.x(), size.y(), word_bytes, origin);
    case Coding::jpeg_2000:
      return decode_jpeg_2000(bytes, size.x(), size.y(), word_bytes, origin);
    default:
      return decode_jpeg(std::move(bytes), coding == Coding::jpeg_lossless, size.x(), size.y(), word_bytes,
                         origin);
  }
}

}  // namespace helicarm::xray
