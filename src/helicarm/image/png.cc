// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/png.h"

#include <algorithm>
#include <cctype>
#include <csetjmp>
#include <cstring>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <png.h>

#include "helicarm/image/exif.h"

namespace helicarm::image {
namespace {

void append(png_structp png, png_bytep bytes, std::size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), size);
}

void keep_message(png_structp png, png_const_charp message) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = message;
  png_longjmp(png, 1);
}

/// Rows of `channels` numbers a pixel of 8 or 16 bits.
struct Rows {
  int width, height, channels, bits;
  const void* first;
  std::size_t stride;  ///< bytes
};

/// Nothing here is destroyed while libpng may longjmp.
bool write_rows(png_structp png, png_infop info, const Rows& rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  // Differences to the row above, barely searched for repetitions: noise has none. A fifth larger than all of
  // libpng's efforts, at a quarter of their time.
  constexpr int level = 2;
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP);
  png_set_compression_level(png, level);
  png_set_IHDR(png, info, static_cast<png_uint_32>(rows.width), static_cast<png_uint_32>(rows.height),
               rows.bits, rows.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // Measured values are linear; what is drawn is for a screen.
  if (rows.bits == 16)
    png_set_gAMA_fixed(png, info, PNG_GAMMA_LINEAR);
  else
    png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_write_info(png, info);
  if (rows.bits == 16) png_set_swap(png);
  for (int v = 0; v < rows.height; ++v)
    png_write_row(png, static_cast<png_const_bytep>(rows.first) + static_cast<std::size_t>(v) * rows.stride);
  png_write_end(png, info);
  return true;
}

std::string encode(const Rows& rows) {
  std::string bytes, message;
  bytes.reserve(static_cast<std::size_t>(rows.height) * rows.stride / 4);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &message, keep_message, nullptr);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  if (!info) {
    png_destroy_write_struct(&png, nullptr);
    throw std::bad_alloc();
  }
  png_set_write_fn(png, &bytes, append, nullptr);
  const bool good = write_rows(png, info, rows);
  png_destroy_write_struct(&png, &info);
  if (!good) throw std::runtime_error(fmt::format("libpng: {}", message));
  return bytes;
}

/// State of libpng's callbacks. Nothing here is destroyed while libpng may longjmp.
struct Reading {
  std::string_view rest;
  bool truncated = false;
  std::string message;
  png_structp png = nullptr;
  png_infop info = nullptr;
  png_uint_32 width = 0, height = 0;
  int bits = 0, colour = 0;
  std::vector<png_byte> row;

  ~Reading() { png_destroy_read_struct(&png, &info, nullptr); }
};

void take(png_structp png, png_bytep out, std::size_t size) {
  auto& reading = *static_cast<Reading*>(png_get_io_ptr(png));
  if (size > reading.rest.size()) {
    reading.truncated = true;
    png_error(png, "the file ends too early");
  }
  std::memcpy(out, reading.rest.data(), size);
  reading.rest.remove_prefix(size);
}

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  static_cast<Reading*>(png_get_error_ptr(png))->message = message;
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

bool read_header(Reading& reading) {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  png_set_user_limits(reading.png, max_image_side, max_image_side);
  png_set_read_fn(reading.png, &reading, take);
  png_read_info(reading.png, reading.info);
  png_get_IHDR(reading.png, reading.info, &reading.width, &reading.height, &reading.bits, &reading.colour,
               nullptr, nullptr, nullptr);
  return true;
}

bool start_rows(Reading& reading) {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  if (reading.bits == 16) png_set_swap(reading.png);
  png_read_update_info(reading.png, reading.info);
  return true;
}

bool read_row(Reading& reading) {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  png_read_row(reading.png, reading.row.data(), nullptr);
  return true;
}

bool read_end(Reading& reading) {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  png_read_end(reading.png, reading.info);
  return true;
}

/// The bytes of a text that ImageMagick writes: a name, a length, and hexadecimal digits, each on new lines.
std::string from_raw_profile(std::string_view text) {
  constexpr int header_lines = 3;
  for (int line = 0; line < header_lines; ++line) {
    const std::size_t end = text.find('\n');
    if (end == text.npos) return {};
    text.remove_prefix(end + 1);
  }
  std::string digits, bytes;
  for (const char c : text)
    if (std::isxdigit(static_cast<unsigned char>(c))) digits += c;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return bytes;
}

/// By the chunk eXIf, or by the text that stood for it before. After the end of the file has been read.
std::optional<int> orientation_of(const Reading& reading) {
  png_uint_32 size = 0;
  png_bytep block = nullptr;
  if (png_get_eXIf_1(reading.png, reading.info, &size, &block) != 0)
    return exif_orientation({reinterpret_cast<const char*>(block), size});
  png_textp texts = nullptr;
  const int count = png_get_text(reading.png, reading.info, &texts, nullptr);
  for (int i = 0; i < count; ++i) {
    const std::string_view key = texts[i].key;
    if (key != "Raw profile type exif" && key != "Raw profile type APP1") continue;
    const std::size_t length = std::max(texts[i].text_length, texts[i].itxt_length);
    if (const auto orientation = exif_orientation(from_raw_profile({texts[i].text, length})))
      return orientation;
  }
  return std::nullopt;
}

double aspect_of(const Reading& reading) {
  png_uint_32 across = 0, down = 0;  // pixels per unit
  int unit = 0;
  png_get_pHYs(reading.png, reading.info, &across, &down, &unit);
  return across > 0 && down > 0 ? double(across) / double(down) : 1;
}

}  // namespace

std::string encode_png(const Image<std::uint8_t>& grey) {
  return encode(
      {grey.width(), grey.height(), 1, 8, grey.pixels().data(), static_cast<std::size_t>(grey.width())});
}

std::string encode_png(const Image<std::uint16_t>& grey) {
  return encode({grey.width(), grey.height(), 1, 16, grey.pixels().data(),
                 sizeof(std::uint16_t) * static_cast<std::size_t>(grey.width())});
}

std::string encode_png(const cv::Mat& rgb) {
  CV_Assert(rgb.type() == CV_8UC3);
  return encode({rgb.cols, rgb.rows, 3, 8, rgb.data, rgb.step});
}

bool is_png(std::string_view bytes) { return bytes.starts_with("\x89PNG\r\n\x1a\n"); }

Expected<GreyImage> decode_png(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    Reading reading{.rest = bytes, .message = {}, .row = {}};
    const auto check = [&](bool good) {
      if (!good)
        throw BadInput(reading.truncated ? Reason::truncated : Reason::bad_value,
                       fmt::format("{}: PNG: {}", origin, reading.message));
    };
    reading.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reading, on_error, on_warning);
    if (reading.png) reading.info = png_create_info_struct(reading.png);
    if (!reading.info) throw std::bad_alloc();
    check(read_header(reading));

    const bool rgb = reading.colour == PNG_COLOR_TYPE_RGB;
    if (!rgb && reading.colour != PNG_COLOR_TYPE_GRAY)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: a PNG with a palette or alpha; convert it to grey", origin));
    if (reading.bits < 8)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: {} bits a pixel; must be 8 or 16", origin, reading.bits));
    if (png_get_interlace_type(reading.png, reading.info) != PNG_INTERLACE_NONE)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: an interlaced PNG; save it without interlacing", origin));
    const std::size_t channels = rgb ? 3 : 1, word = reading.bits == 16 ? 2 : 1;
    if (std::size_t{reading.width} * reading.height * word > max_image_bytes)
      throw BadInput(Reason::bad_size, fmt::format("{}: {} x {} pixels are more than {} bytes", origin,
                                                   reading.width, reading.height, max_image_bytes));
    check(start_rows(reading));

    GreyImage grey_image{
        {static_cast<int>(reading.width), static_cast<int>(reading.height)}, reading.bits, 1};
    reading.row.resize(reading.width * channels * word);
    for (int v = 0; v < grey_image.pixels.height(); ++v) {
      check(read_row(reading));
      for (int u = 0; u < grey_image.pixels.width(); ++u) {
        const png_byte* at = reading.row.data() + static_cast<std::size_t>(u) * channels * word;
        if (rgb && (std::memcmp(at, at + word, word) != 0 || std::memcmp(at, at + 2 * word, word) != 0))
          throw BadInput(Reason::unsupported, fmt::format("{}: a colour image; convert it to grey", origin));
        std::uint16_t value = *at;
        if (word == 2) std::memcpy(&value, at, 2);
        grey_image.pixels(u, v) = value;
      }
    }
    check(read_end(reading));
    check_orientation(orientation_of(reading).value_or(1), origin);
    grey_image.pixel_aspect = aspect_of(reading);
    return grey_image;
  });
}

}  // namespace helicarm::image
