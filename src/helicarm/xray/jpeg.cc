// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/jpeg.h"

#include <algorithm>
#include <optional>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djdijg12.h>
#include <dcmtk/dcmjpeg/djdijg16.h>
#include <dcmtk/dcmjpeg/djdijg8.h>
#include <fmt/format.h>

#include "helicarm/image/exif.h"
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

bool is_application_0(int marker) { return marker == 0xE0; }
bool is_application_1(int marker) { return marker == 0xE1; }

/// Of EXIF data before the frame header.
std::optional<int> jpeg_orientation(std::string_view jpeg) {
  for (std::size_t at = 2; (at = find_segment(jpeg, at, is_application_1)) != jpeg.npos;) {
    const auto length = static_cast<std::size_t>(word_at(jpeg, at + 2));
    const std::string_view segment = jpeg.substr(at + 4, length - std::min<std::size_t>(length, 2));
    if (segment.starts_with("Exif"))
      if (const auto orientation = image::exif_orientation(segment)) return orientation;
    at += 2 + std::max<std::size_t>(length, 2);
    if (at > jpeg.size()) break;
  }
  return std::nullopt;
}

/// Height of a pixel to its width by the JFIF header's densities.
double jpeg_aspect(std::string_view jpeg) {
  const std::size_t at = find_segment(jpeg, 2, is_application_0);
  if (at == jpeg.npos || jpeg.size() - at < 16 || jpeg.substr(at + 4, 4) != "JFIF") return 1;
  const int across = word_at(jpeg, at + 12), down = word_at(jpeg, at + 14);
  return across > 0 && down > 0 ? double(across) / down : 1;
}

/// Grey of three components that show no colour, as stored: equal, or luminance with neutral chrominance.
std::optional<std::string> grey_of(std::string_view triples) {
  constexpr char neutral = '\x80';
  std::string grey;
  grey.reserve(triples.size() / 3);
  bool equal = true, chrominance = true;
  for (std::size_t i = 0; i + 2 < triples.size(); i += 3) {
    equal = equal && triples[i] == triples[i + 1] && triples[i] == triples[i + 2];
    chrominance = chrominance && triples[i + 1] == neutral && triples[i + 2] == neutral;
    grey += triples[i];
  }
  return equal || chrominance ? std::optional(grey) : std::nullopt;
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
  // Some writers leave bytes behind it.
  if (jpeg.find("\xFF\xD9", frame) == std::string::npos)
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

bool is_jpeg_file(std::string_view bytes) { return bytes.starts_with("\xFF\xD8\xFF"); }

Expected<image::GreyImage> decode_jpeg_file(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    const auto refuse = [&](Reason reason, std::string_view why) {
      throw BadInput(reason, fmt::format("{}: JPEG: {}", origin, why));
    };
    const std::size_t frame = find_segment(bytes, 2, starts_frame);
    if (frame == bytes.npos) refuse(Reason::bad_value, "no frame header");
    const int process = byte_at(bytes, frame + 1) & 15, precision = byte_at(bytes, frame + 4);
    const int rows = word_at(bytes, frame + 5), columns = word_at(bytes, frame + 7),
              components = byte_at(bytes, frame + 9);
    if (process > 2 || precision != 8)
      refuse(Reason::unsupported,
             fmt::format("process {} of {} bits, must be baseline, extended or progressive of 8; "
                         "save it as PNG",
                         process, precision));
    if (components != 1 && components != 3)
      refuse(Reason::unsupported, fmt::format("{} components, must be grey; convert it to grey", components));
    const auto pixels = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    if (pixels < 1 || rows > int(image::max_image_side) || columns > int(image::max_image_side) ||
        pixels > image::max_image_bytes)
      refuse(Reason::bad_size, fmt::format("{} x {} pixels, limit {} a side and {} bytes", columns, rows,
                                           image::max_image_side, image::max_image_bytes));
    image::check_orientation(jpeg_orientation(bytes).value_or(1), origin);
    if (bytes.find("\xFF\xD9", frame) == bytes.npos)
      refuse(Reason::truncated, "the file ends before the image does");
    std::string stored(pixels * static_cast<std::size_t>(components), '\0');
    if (!decode<DJDecompressIJG8Bit>(bytes, stored)) refuse(Reason::bad_value, "damaged");
    if (components == 3) {
      auto grey = grey_of(stored);
      if (!grey) refuse(Reason::unsupported, "a colour image; convert it to grey");
      stored = *std::move(grey);
    }
    image::GreyImage grey_image{{columns, rows}, 8, jpeg_aspect(bytes)};
    std::ranges::transform(stored, grey_image.pixels.pixels().begin(),
                           [](char grey) { return static_cast<unsigned char>(grey); });
    return grey_image;
  });
}

}  // namespace helicarm::xray
