// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/tiff.h"

#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>
#include <vector>

#include <fmt/format.h>
#include <tiffio.h>

#include "helicarm/image/exif.h"

namespace helicarm::image {
namespace {

/// The file in memory, as libtiff's I/O callbacks read it.
struct Source {
  std::string_view bytes;
  toff_t at = 0;
};

Source& source(thandle_t handle) { return *static_cast<Source*>(handle); }

tmsize_t take(thandle_t handle, void* out, tmsize_t size) {
  Source& from = source(handle);
  const toff_t left = from.at < from.bytes.size() ? from.bytes.size() - from.at : 0;
  const toff_t count = std::min<toff_t>(left, static_cast<toff_t>(size));
  if (count > 0) std::memcpy(out, from.bytes.data() + from.at, count);
  from.at += count;
  return static_cast<tmsize_t>(count);
}

tmsize_t no_write(thandle_t, void*, tmsize_t) { return -1; }

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  Source& from = source(handle);
  from.at = whence == SEEK_SET ? offset : whence == SEEK_CUR ? from.at + offset : from.bytes.size() + offset;
  return from.at;
}

int close(thandle_t) { return 0; }

toff_t size(thandle_t handle) { return source(handle).bytes.size(); }

int map(thandle_t handle, void** base, toff_t* length) {
  *base = const_cast<char*>(source(handle).bytes.data());
  *length = source(handle).bytes.size();
  return 1;
}

void unmap(thandle_t, void*, toff_t) {}

using File = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

File open(Source& from, const std::string& origin) {
  static std::once_flag silenced;
  std::call_once(silenced, [] {
    TIFFSetErrorHandler(nullptr);
    TIFFSetWarningHandler(nullptr);
  });
  File file(TIFFClientOpen(origin.c_str(), "r", &from, take, no_write, seek, close, size, map, unmap),
            &TIFFClose);
  if (!file) throw BadInput(Reason::bad_value, fmt::format("{}: TIFF: damaged or truncated", origin));
  return file;
}

struct Layout {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, channels = 1, photometric = 0, format = SAMPLEFORMAT_UINT,
                planes = PLANARCONFIG_CONTIG, compression = COMPRESSION_NONE,
                orientation = ORIENTATION_TOPLEFT;
  double pixel_aspect = 1;
};

Layout read_layout(TIFF* tiff, const std::string& origin) {
  Layout layout;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &layout.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &layout.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &layout.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &layout.channels);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &layout.format);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &layout.planes);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &layout.compression);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ORIENTATION, &layout.orientation);
  float across = 0, down = 0;  // pixels per unit
  if (TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &across) && TIFFGetField(tiff, TIFFTAG_YRESOLUTION, &down) &&
      across > 0 && down > 0 && std::isfinite(across / down))
    layout.pixel_aspect = double(across) / double(down);
  if (!TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &layout.photometric))
    throw BadInput(Reason::bad_value, fmt::format("{}: TIFF without a photometric interpretation", origin));
  return layout;
}

void check_layout(const Layout& layout, TIFF* tiff, const std::string& origin) {
  const auto unless = [&](bool good, const char* what) {
    if (!good) throw BadInput(Reason::unsupported, fmt::format("{}: {}", origin, what));
  };
  const bool grey =
      layout.photometric == PHOTOMETRIC_MINISBLACK || layout.photometric == PHOTOMETRIC_MINISWHITE;
  const bool rgb = layout.photometric == PHOTOMETRIC_RGB;
  unless(grey || rgb, "a TIFF with a palette or other colours; must be grey");
  unless(layout.channels == (rgb ? 3 : 1), "a TIFF with alpha or extra channels; must be grey");
  unless(layout.bits == 8 || layout.bits == 16, "the TIFF's samples must have 8 or 16 bits");
  unless(layout.format == SAMPLEFORMAT_UINT, "the TIFF's samples must be unsigned whole numbers");
  unless(layout.planes == PLANARCONFIG_CONTIG, "a TIFF with separate colour planes");
  unless(!TIFFIsTiled(tiff), "a tiled TIFF; must be in strips");
  unless(layout.compression == COMPRESSION_NONE || layout.compression == COMPRESSION_LZW ||
             layout.compression == COMPRESSION_PACKBITS || layout.compression == COMPRESSION_ADOBE_DEFLATE ||
             layout.compression == COMPRESSION_DEFLATE,
         "the TIFF's compression must be none, PackBits, LZW or deflate");
  check_orientation(layout.orientation, origin);
  if (layout.width < 1 || layout.height < 1 || layout.width > max_image_side ||
      layout.height > max_image_side ||
      std::size_t{layout.width} * layout.height * (layout.bits / 8u) > max_image_bytes)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} x {} pixels, limit {} a side and {} bytes", origin, layout.width,
                               layout.height, max_image_side, max_image_bytes));
}

}  // namespace

bool is_tiff(std::string_view bytes) {
  using namespace std::literals;
  // BigTIFF has the version 43 in place of 42.
  return bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv) || bytes.starts_with("II+\0"sv) ||
         bytes.starts_with("MM\0+"sv);
}

Expected<int> count_tiff_pages(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    Source from{bytes};
    const int pages = static_cast<int>(TIFFNumberOfDirectories(open(from, origin).get()));
    // libtiff opens a file with a truncated first directory and counts no pages.
    if (pages < 1) throw BadInput(Reason::bad_value, fmt::format("{}: TIFF: damaged or truncated", origin));
    return pages;
  });
}

Expected<std::array<int, 2>> tiff_size(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    Source from{bytes};
    const Layout layout = read_layout(open(from, origin).get(), origin);
    return std::array{int(layout.width), int(layout.height)};
  });
}

Expected<GreyImage> decode_tiff(std::string_view bytes, int page, const std::string& origin) {
  return guarded([&] {
    Source from{bytes};
    const File file = open(from, origin);
    if (!TIFFSetDirectory(file.get(), static_cast<tdir_t>(page)))
      throw BadInput(Reason::bad_value, fmt::format("{}: TIFF page {} is damaged", origin, page + 1));
    const Layout layout = read_layout(file.get(), origin);
    check_layout(layout, file.get(), origin);

    const std::size_t word = layout.bits / 8u;
    GreyImage grey_image{{static_cast<int>(layout.width), static_cast<int>(layout.height)},
                         layout.bits,
                         layout.pixel_aspect,
                         layout.photometric == PHOTOMETRIC_MINISWHITE};
    std::vector<unsigned char> row(
        std::max<std::size_t>(std::size_t{layout.width} * layout.channels * word,
                              static_cast<std::size_t>(TIFFScanlineSize(file.get()))));
    for (std::uint32_t v = 0; v < layout.height; ++v) {
      if (TIFFReadScanline(file.get(), row.data(), v) != 1)
        throw BadInput(Reason::truncated, fmt::format("{}: TIFF row {} is damaged or missing", origin, v));
      for (std::uint32_t u = 0; u < layout.width; ++u) {
        const unsigned char* at = row.data() + std::size_t{u} * layout.channels * word;
        if (layout.channels == 3 &&
            (std::memcmp(at, at + word, word) != 0 || std::memcmp(at, at + 2 * word, word) != 0))
          throw BadInput(Reason::unsupported, fmt::format("{}: a colour image; convert it to grey", origin));
        std::uint16_t value = *at;
        if (word == 2) std::memcpy(&value, at, 2);
        grey_image.pixels(static_cast<int>(u), static_cast<int>(v)) = value;
      }
    }
    return grey_image;
  });
}

}  // namespace helicarm::image
