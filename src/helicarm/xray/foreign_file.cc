// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/foreign_file.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

namespace helicarm::xray {
namespace {

using namespace std::literals;

constexpr std::string_view save_as_png = "save it as PNG, TIFF or DICOM";
constexpr std::string_view export_frames =
    "it is read where Debian's package ffmpeg is installed; or export its frames as images without loss, for "
    "example "
    "with ffmpeg -i FILE -vsync passthrough frame_%04d.png";
constexpr std::string_view unpack_it_first = "unpack it first";
constexpr std::string_view as_model = "a volume is no X-ray image; name it as a model, see docs/formats.md";

struct Signature {
  std::size_t at;
  std::string_view bytes;
  std::string_view what, way_out;
  std::string_view container = {};  ///< of a film, as ffmpeg names it
};

constexpr std::array signatures = {
    Signature{0, "GIF8"sv, "a GIF image", save_as_png},
    Signature{8, "WEBP"sv, "a WebP image", save_as_png},
    Signature{8, "AVI "sv, "an AVI film", export_frames, "avi"},
    Signature{4, "ftypheic"sv, "a HEIC image", save_as_png},
    Signature{4, "ftypmif1"sv, "a HEIF image", save_as_png},
    Signature{4, "ftypavif"sv, "an AVIF image", save_as_png},
    Signature{4, "ftyp"sv, "an MP4 or QuickTime film", export_frames, "mov"},
    Signature{4, "moov"sv, "a QuickTime film", export_frames, "mov"},
    Signature{4, "wide"sv, "a QuickTime film", export_frames, "mov"},
    Signature{4, "mdat"sv, "a QuickTime film", export_frames, "mov"},
    Signature{0, "\x1A\x45\xDF\xA3"sv, "a Matroska or WebM film", export_frames, "matroska"},
    Signature{0, "\x30\x26\xB2\x75\x8E\x66\xCF\x11"sv, "a Windows Media film", export_frames, "asf"},
    Signature{0, "\0\0\1\xBA"sv, "an MPEG film", export_frames, "mpeg"},
    Signature{4, "jP  \r\n\x87\n"sv, "a JPEG 2000 file", save_as_png},
    Signature{0, "\xFF\x4F\xFF\x51"sv, "a JPEG 2000 codestream", save_as_png},
    Signature{0, "\xFF\x0A"sv, "a JPEG XL image", save_as_png},
    Signature{4, "JXL \r\n\x87\n"sv, "a JPEG XL image", save_as_png},
    Signature{0, "P2"sv, "a PGM image", save_as_png},
    Signature{0, "P5"sv, "a PGM image", save_as_png},
    Signature{0, "P6"sv, "a PPM image", save_as_png},
    Signature{0, "\x76\x2F\x31\x01"sv, "an OpenEXR image", save_as_png},
    Signature{0, "SIMPLE  ="sv, "a FITS image", save_as_png},
    Signature{0, "\0\x70\x44\0"sv, "a PerkinElmer HIS image", save_as_png},
    Signature{0, "8BPS"sv, "a Photoshop file", save_as_png},
    Signature{0, "%PDF"sv, "a PDF file", "export its images as PNG"},
    Signature{0, "\x1F\x8B"sv, "a gzip file", unpack_it_first},
    Signature{0, "PK\3\4"sv, "a ZIP archive", unpack_it_first},
    Signature{0, "7z\xBC\xAF"sv, "a 7-Zip archive", unpack_it_first},
    Signature{0, "BZh"sv, "a bzip2 file", unpack_it_first},
    Signature{0,
              "\xFD"
              "7zXZ"sv,
              "an xz file", unpack_it_first},
    Signature{0, "NRRD"sv, "an NRRD file", as_model},
    Signature{0, "ObjectType"sv, "a MetaImage header", as_model},
    Signature{0, "NDims"sv, "a MetaImage header", as_model},
    Signature{344, "n+1\0"sv, "a NIfTI volume", as_model},
    Signature{344, "ni1\0"sv, "a NIfTI header", as_model},
    Signature{4, "n+2\0"sv, "a NIfTI volume", as_model},
    Signature{4, "ni2\0"sv, "a NIfTI header", as_model},
    Signature{0, "version https://git-lfs"sv, "a Git LFS pointer, not the file itself", "run git lfs pull"},
};

bool has(std::string_view bytes, const Signature& signature) {
  return bytes.size() >= signature.at && bytes.substr(signature.at).starts_with(signature.bytes);
}

bool is_text(std::string_view bytes) {
  return std::ranges::all_of(bytes.substr(0, 512),
                             [](unsigned char c) { return c >= 0x80 || std::isprint(c) || std::isspace(c); });
}

/// The first character says what kind of text it is.
std::optional<std::string> text_kind(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == text.npos || !is_text(text)) return std::nullopt;
  if (text[first] == '{' || text[first] == '[') return "a JSON file; name the image itself";
  if (text[first] == '<') return "an XML or HTML file; name the image itself";
  return "a text file; name the image itself";
}

}  // namespace

std::string_view film_container(std::string_view bytes) {
  for (const Signature& signature : signatures)
    if (has(bytes, signature)) return signature.container;
  return {};
}

std::optional<std::string> foreign_file(std::string_view bytes) {
  for (const Signature& signature : signatures)
    if (has(bytes, signature)) return fmt::format("{}; {}", signature.what, signature.way_out);
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
    return "a text in UTF-16; name the image itself";
  return text_kind(bytes);
}

}  // namespace helicarm::xray
