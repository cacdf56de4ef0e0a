// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/nrrd_sequence.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#define ZLIB_CONST
#include <zlib.h>

#include "helicarm/xray/dicom_elements.h"

namespace helicarm::xray {
namespace {

constexpr std::string_view magic = "NRRD000";
constexpr std::size_t most_sequence_bytes = std::size_t{4} << 30;

/// Fields in small letters, their names without blanks, and where the values begin.
struct SequenceHeader {
  std::map<std::string, std::string> fields;
  std::size_t values_at = 0;
  std::string given_twice;  ///< a field's name; empty: none

  std::string field(const char* name) const {
    const auto found = fields.find(name);
    return found == fields.end() ? "" : found->second;
  }
};

std::string small_trimmed(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front()))) text.remove_prefix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.remove_suffix(1);
  std::string small(text);
  std::ranges::transform(small, small.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return small;
}

/// Nothing where no empty line ends the header.
std::optional<SequenceHeader> header_of(std::string_view bytes) {
  constexpr std::size_t most_header_bytes = 1 << 24;  // Slicer writes a line for each image
  if (!bytes.starts_with(magic)) return {};
  SequenceHeader header;
  std::size_t at = 0;
  while (at < std::min(bytes.size(), most_header_bytes)) {
    const std::size_t end = bytes.find('\n', at);
    if (end == bytes.npos) return {};
    std::string_view line = bytes.substr(at, end - at);
    at = end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty()) {
      header.values_at = at;
      return header;
    }
    const std::size_t colon = line.find(':');
    const bool is_field = colon != line.npos && line.substr(colon + 1, 1) != "=" && line.front() != '#';
    if (!is_field) continue;
    std::string name = small_trimmed(line.substr(0, colon));
    std::erase(name, ' ');  // Teem knows "byte skip" and "byteskip"
    if (!header.fields.emplace(name, small_trimmed(line.substr(colon + 1))).second) header.given_twice = name;
  }
  return {};
}

/// Whole positive numbers apart by blanks; empty where one is none.
std::vector<std::size_t> sizes_in(const std::string& text) {
  std::vector<std::size_t> sizes;
  const char *at = text.data(), *const end = at + text.size();
  while (at < end) {
    while (at < end && *at == ' ') ++at;
    std::size_t size = 0;
    const auto [next, error] = std::from_chars(at, end, size);
    if (error != std::errc() || size == 0) return {};
    sizes.push_back(size);
    at = next;
  }
  return sizes;
}

bool is_of_images(const std::vector<std::size_t>& sizes) {
  return sizes.size() == 2 || (sizes.size() == 4 && sizes[2] == 1) || (sizes.size() == 3 && sizes[2] == 1);
}

/// How the images lie in the file.
struct SequenceLayout {
  std::size_t width, height, images, values_at;
  int bytes_each;  ///< of a value
  bool is_signed, is_big_endian, is_packed;

  std::size_t image_bytes() const { return width * height * std::size_t(bytes_each); }
};

SequenceLayout layout_of(std::string_view bytes, const std::string& origin) {
  const auto header = header_of(bytes);
  const std::vector<std::size_t> sizes =
      header ? sizes_in(header->field("sizes")) : std::vector<std::size_t>{};
  if (!is_of_images(sizes))
    throw BadInput(Reason::bad_value, fmt::format("{}: is no NRRD file of images", origin));
  if (!header->given_twice.empty())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {} is given twice", origin, quote(header->given_twice)));
  const auto unsupported = [&](const char* name) {
    return BadInput(Reason::unsupported,
                    fmt::format("{}: \"{}\" is {}; read are images with values of 8 or 16 bits, whole "
                                "numbers, in the file itself from its first byte on, raw or packed by gzip",
                                origin, name, quote(header->field(name))));
  };
  if (header->fields.contains("datafile")) throw unsupported("datafile");
  for (const char* name : {"byteskip", "lineskip"})
    if (const std::string skip = header->field(name);
        !skip.empty() && skip != "0" && !(skip == "-1" && std::string_view(name) == "byteskip"))
      throw unsupported(name);
  SequenceLayout layout{
      sizes[0], sizes[1], sizes.size() == 4 ? sizes[3] : 1, header->values_at,
      0,        false,    header->field("endian") == "big", header->field("encoding").starts_with("gz")};
  if (!layout.is_packed && header->field("encoding") != "raw") throw unsupported("encoding");
  if (layout.is_packed && header->field("byteskip") == "-1") throw unsupported("byteskip");
  const std::string type = header->field("type");
  const auto is_one_of = [&](std::initializer_list<const char*> names) {
    return std::ranges::find(names, type) != names.end();
  };
  if (is_one_of({"uchar", "unsigned char", "uint8", "uint8_t"}))
    layout.bytes_each = 1;
  else if (is_one_of({"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}))
    layout.bytes_each = 2;
  else if (is_one_of({"short", "short int", "signed short", "signed short int", "int16", "int16_t"}))
    layout.bytes_each = 2, layout.is_signed = true;
  else
    throw unsupported("type");
  const std::string endian = header->field("endian");
  if (endian != "little" && endian != "big" && (!endian.empty() || layout.bytes_each == 2))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: endian is {}, must be little or big", origin, quote(endian)));
  if (layout.width > image::max_image_side || layout.height > image::max_image_side ||
      layout.image_bytes() > image::max_image_bytes ||
      layout.images > most_sequence_bytes / layout.image_bytes())
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} images of {} x {} pixels, limit 16384 pixels a side, "
                               "64 MiB an image, 4 GiB",
                               origin, layout.images, layout.width, layout.height));
  return layout;
}

/// Exactly `size` bytes, of all members of a gzip file. Memory grows with what is found, not with what the
/// header says.
std::string inflated(std::string_view packed, std::size_t size, const std::string& origin) {
  z_stream stream{};
  constexpr int zlib_or_gzip = 15 + 32;
  constexpr std::size_t step = std::size_t{1} << 24;
  if (inflateInit2(&stream, zlib_or_gzip) != Z_OK) throw std::bad_alloc();
  const std::size_t most = size + 1;  // one byte more tells that there are more
  std::string plain;
  int state = Z_OK;
  while (state == Z_OK && plain.size() < most) {
    const std::size_t written = plain.size(), in = std::min(packed.size(), step);
    plain.resize(std::min(most, written + step));
    stream.next_in = reinterpret_cast<const Bytef*>(packed.data());
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = reinterpret_cast<Bytef*>(plain.data() + written);
    stream.avail_out = static_cast<uInt>(plain.size() - written);
    state = inflate(&stream, Z_NO_FLUSH);
    packed.remove_prefix(in - stream.avail_in);
    plain.resize(plain.size() - stream.avail_out);
    if (state == Z_STREAM_END && packed.starts_with("\x1f\x8b")) state = inflateReset(&stream);
  }
  inflateEnd(&stream);
  if (state == Z_DATA_ERROR)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: its values are damaged after {} bytes", origin, plain.size()));
  const bool padded = packed.find_first_not_of(std::string_view("\0\r\n", 3)) == packed.npos;
  if (plain.size() > size || (state == Z_STREAM_END && !padded))
    throw BadInput(Reason::surplus_data,
                   fmt::format("{}: holds more than the {} bytes that its sizes take", origin, size));
  if (plain.size() < size)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: its values end after {} of {} bytes", origin, plain.size(), size));
  return plain;
}

}  // namespace

bool is_nrrd_sequence(std::string_view bytes) {
  const auto header = header_of(bytes);
  return header && is_of_images(sizes_in(header->field("sizes")));
}

int images_of_sequence(std::string_view bytes, const std::string& origin) {
  return int(layout_of(bytes, origin).images);
}

std::string unpacked_sequence(std::string bytes, const std::string& origin) {
  const SequenceLayout layout = layout_of(bytes, origin);
  const std::size_t size = layout.images * layout.image_bytes();
  const std::string_view values = std::string_view(bytes).substr(layout.values_at);
  if (!layout.is_packed) {
    if (values.size() == size) return bytes;
    throw BadInput(values.size() < size ? Reason::truncated : Reason::surplus_data,
                   fmt::format("{}: {} bytes of values, its sizes take {}", origin, values.size(), size));
  }
  return fmt::format("NRRD0004\ntype: {}\ndimension: 4\nsizes: {} {} 1 {}\nendian: {}\nencoding: raw\n\n",
                     layout.bytes_each == 1 ? "uint8"
                     : layout.is_signed     ? "int16"
                                            : "uint16",
                     layout.width, layout.height, layout.images, layout.is_big_endian ? "big" : "little") +
         inflated(values, size, origin);
}

image::GreyImage image_of_sequence(std::string_view unpacked, int index, const std::string& origin) {
  const SequenceLayout layout = layout_of(unpacked, origin);
  const std::string_view values =
      unpacked.substr(layout.values_at + std::size_t(index) * layout.image_bytes(), layout.image_bytes());
  image::GreyImage image{image::Image<std::uint16_t>(int(layout.width), int(layout.height)),
                         8 * layout.bytes_each};
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(values[i]); };
  std::size_t at = 0;
  for (std::uint16_t& pixel : image.pixels.pixels()) {
    const unsigned first = byte(at), second = layout.bytes_each == 2 ? byte(at + 1) : 0;
    pixel = static_cast<std::uint16_t>(layout.bytes_each == 1 ? first
                                       : layout.is_big_endian ? 256 * first + second
                                                              : 256 * second + first);
    if (layout.is_signed && pixel > 0x7FFF)
      throw BadInput(Reason::bad_value, fmt::format("{}: image {} has negative values", origin, index + 1));
    at += std::size_t(layout.bytes_each);
  }
  return image;
}

}  // namespace helicarm::xray
