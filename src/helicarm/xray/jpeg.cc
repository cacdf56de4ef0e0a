// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/jpeg.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djdijg12.h>
#include <dcmtk/dcmjpeg/djdijg16.h>
#include <dcmtk/dcmjpeg/djdijg8.h>
#include <fmt/format.h>

namespace helicarm {
namespace {

/// DCMTK's decoder without its log; it tells damage only by warnings.
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

struct FrameHeader {
  int process = -1;  ///< low half of the SOF marker
  int precision = 0;
  int height = 0;
  int width = 0;
  int components = 0;
};

/// Walks the marker segments up to the frame header, which DCMTK would believe; process -1 when there is
/// none.
FrameHeader find_frame_header(std::string_view jpeg) {
  const auto byte = [&](std::size_t at) { return static_cast<int>(static_cast<unsigned char>(jpeg[at])); };
  const auto word = [&](std::size_t at) { return byte(at) << 8 | byte(at + 1); };
  std::size_t at = 2;
  while (jpeg.size() - at >= 10 && byte(at) == 0xFF) {
    const int marker = byte(at + 1);
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC)
      return {marker & 15, byte(at + 4), word(at + 5), word(at + 7), byte(at + 9)};
    const auto length = static_cast<std::size_t>(word(at + 2));
    const bool has_segment = marker >= 0xC0 && (marker < 0xD0 || marker > 0xDA);
    if (!has_segment || length < 2 || length + 2 > jpeg.size() - at) break;
    at += 2 + length;
  }
  return {};
}

}  // namespace

Expected<std::string> decode_jpeg(std::string_view jpeg, bool lossless, int width, int height, int word_bytes,
                                  const std::string& origin) {
  const auto damaged = [&](std::string_view why) {
    return fail(Reason::bad_value, fmt::format("{}: JPEG data: {}", origin, why));
  };
  if (!jpeg.starts_with("\xFF\xD8")) return damaged("no start of an image");
  const FrameHeader header = find_frame_header(jpeg);
  if (header.process < 0) return damaged("no frame header");
  if (lossless ? header.process != 3 : header.process > 1)
    return damaged(fmt::format("frame type {} does not suit the transfer syntax", header.process));
  if (header.width != width || header.height != height || header.components != 1)
    return damaged(fmt::format("{} x {} pixels of {} component(s), must be {} x {} of 1", header.width,
                               header.height, header.components, width, height));
  if (header.precision < 2 || header.precision > 8 * word_bytes)
    return damaged(fmt::format("{} bits a pixel, {} allocated", header.precision, 8 * word_bytes));
  const auto last = jpeg.find_last_not_of(std::string_view("\0", 1));
  if (jpeg.substr(0, last + 1).find("\xFF\xD9", last - 2) == std::string_view::npos)
    return fail(Reason::truncated, fmt::format("{}: the JPEG data has no end", origin));

  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::string out(pixels * (header.precision > 8 ? 2 : 1), '\0');
  const bool good = header.precision <= 8    ? decode<DJDecompressIJG8Bit>(jpeg, out)
                    : header.precision <= 12 ? decode<DJDecompressIJG12Bit>(jpeg, out)
                                             : decode<DJDecompressIJG16Bit>(jpeg, out);
  if (!good) return damaged("damaged");
  if (header.precision > 8 || word_bytes == 1) return out;
  std::string wide(2 * pixels, '\0');
  for (std::size_t i = 0; i < pixels; ++i) wide[2 * i] = out[i];
  return wide;
}

}  // namespace helicarm
