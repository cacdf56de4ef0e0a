// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/jpeg.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djdijg12.h>
#include <dcmtk/dcmjpeg/djdijg16.h>
#include <dcmtk/dcmjpeg/djdijg8.h>
#include <fmt/format.h>

#include "helicarm/xray/words.h"

namespace helicarm::xray {
namespace {

/// DCMTK's decoder with its log suppressed; DCMTK reports damage only as warnings.
template <class Decoder>
class QuietDecoder final : public Decoder {
 public:
  explicit QuietDecoder(const DJCodecParameter& parameters) : Decoder(parameters, OFFalse) {}
  void emitMessage(int level) const override { damaged_ |= level < 0; }
  bool damaged() const { return damaged_; }

 private:
  mutable bool damaged_ = false;
};

template <class Decoder>
bool decode(std::string_view jpeg, std::string& out) {
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_never, EUC_never, EPC_default);
  QuietDecoder<Decoder> decoder(parameters);
  if (decoder.init().bad()) return false;
  auto* from = reinterpret_cast<Uint8*>(const_cast<char*>(jpeg.data()));
  const OFCondition status =
      decoder.decode(from, static_cast<Uint32>(jpeg.size()), reinterpret_cast<Uint8*>(out.data()),
                     static_cast<Uint32>(out.size()), OFFalse);
  return status.good() && !decoder.damaged();
}

int byte_at(std::string_view jpeg, std::size_t at) { return static_cast<unsigned char>(jpeg[at]); }
int word_at(std::string_view jpeg, std::size_t at) { return byte_at(jpeg, at) << 8 | byte_at(jpeg, at + 1); }

bool starts_frame(int marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}
bool starts_scan(int marker) { return marker == 0xDA; }

/// Walks the marker segments from `at` to the first wanted one of at least ten bytes; npos if there is none.
std::size_t find_segment(std::string_view jpeg, std::size_t at, bool (*wanted)(int)) {
  while (jpeg.size() - at >= 10 && byte_at(jpeg, at) == 0xFF) {
    const int marker = byte_at(jpeg, at + 1);
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (wanted(marker)) return at;
    const auto length = static_cast<std::size_t>(word_at(jpeg, at + 2));
    const bool has_segment = marker >= 0xC0 && (marker < 0xD0 || marker > 0xDA);
    if (!has_segment || length < 2 || length + 2 > jpeg.size() - at) break;
    at += 2 + length;
  }
  return std::string_view::npos;
}

/// A sequential scan always covers coefficients 0 to 63; some writers store other numbers.
void correct_scan_header(std::string& jpeg, std::size_t frame) {
  const std::size_t scan = find_segment(jpeg, frame, starts_scan);
  if (scan != std::string::npos && word_at(jpeg, scan + 2) == 8)
    jpeg.replace(scan + 7, 3, std::string("\0\x3F\0", 3));
}

}  // namespace

Expected<std::string> decode_jpeg(std::string jpeg, bool lossless, int width, int height, int word_bytes,
                                  const std::string& origin) {
  const auto damaged = [&](std::string_view why) {
    return fail(Reason::bad_value, fmt::format("{}: JPEG data: {}", origin, why));
  };
  if (!jpeg.starts_with("\xFF\xD8")) return damaged("no start of image marker");
  const std::size_t frame = find_segment(jpeg, 2, starts_frame);
  if (frame == std::string::npos) return damaged("no frame header");
  const int process = byte_at(jpeg, frame + 1) & 15, precision = byte_at(jpeg, frame + 4);
  const int rows = word_at(jpeg, frame + 5), columns = word_at(jpeg, frame + 7),
            components = byte_at(jpeg, frame + 9);
  if (lossless ? process != 3 : process > 1)
    return damaged(fmt::format("frame type {} does not suit the transfer syntax", process));
  if (columns != width || rows != height || components != 1)
    return damaged(fmt::format("{} x {} pixels of {} component(s), must be {} x {} of 1", columns, rows,
                               components, width, height));
  if (precision < 2 || precision > 8 * word_bytes)
    return damaged(fmt::format("{} bits a pixel, {} allocated", precision, 8 * word_bytes));
  const auto last = jpeg.find_last_not_of(std::string_view("\0", 1));
  if (jpeg.find("\xFF\xD9", last - 2) == std::string::npos)
    return fail(Reason::truncated, fmt::format("{}: the JPEG data have no end of image marker", origin));

  if (!lossless) correct_scan_header(jpeg, frame);

  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::string out(pixels * (precision > 8 ? 2 : 1), '\0');
  const bool good = precision <= 8    ? decode<DJDecompressIJG8Bit>(jpeg, out)
                    : precision <= 12 ? decode<DJDecompressIJG12Bit>(jpeg, out)
                                      : decode<DJDecompressIJG16Bit>(jpeg, out);
  if (!good) return damaged("damaged");
  if (precision > 8 || word_bytes == 1) return out;
  return widened(out);
}

}  // namespace helicarm::xray
