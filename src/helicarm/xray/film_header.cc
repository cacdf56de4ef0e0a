// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/film_header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/xray/child_program.h"

namespace helicarm::xray {
namespace {

namespace fs = std::filesystem;

std::size_t half(int side) { return std::size_t(side + 1) / 2; }
std::size_t quarter(int side) { return std::size_t(side + 3) / 4; }

/// Planar formats whose luminance comes first, "yuv420p10le" and "gray12le" among them; nothing for others.
std::optional<PixelLayout> luminance_layout(std::string format, int width, int height) {
  PixelLayout layout;
  if (format.ends_with("le")) format.resize(format.size() - 2);
  const auto stem = [&](std::string_view name) {
    if (!format.starts_with(name)) return false;
    const std::string_view digits = std::string_view(format).substr(name.size());
    if (digits.empty()) return true;
    int bits = 0;
    const auto [end, error] = std::from_chars(digits.begin(), digits.end(), bits);
    if (error != std::errc{} || end != digits.end() || bits < 9 || bits > 16) return false;
    layout.bits = bits;
    return true;
  };
  const std::size_t rows = std::size_t(height), columns = std::size_t(width);
  if (stem("gray")) return layout;
  const struct {
    std::string_view name;
    std::size_t chrominance;
  } planar[] = {{"yuv420p", half(width) * half(height)},
                {"yuvj420p", half(width) * half(height)},
                {"yuv422p", half(width) * rows},
                {"yuvj422p", half(width) * rows},
                {"yuv444p", columns * rows},
                {"yuvj444p", columns * rows},
                {"yuv411p", quarter(width) * rows},
                {"yuvj411p", quarter(width) * rows},
                {"yuv440p", columns * half(height)},
                {"yuvj440p", columns * half(height)},
                {"nv12", half(width) * half(height)},
                {"nv21", half(width) * half(height)}};
  for (const auto& [name, chrominance] : planar)
    if (stem(name)) {
      layout.chrominance = 2 * chrominance;
      return layout;
    }
  return std::nullopt;
}

std::string all_output(ChildProgram& program) {
  constexpr std::size_t most = 1 << 20;
  std::string text(most, '\0');
  text.resize(program.read(text));
  return text;
}

int whole(const Json& stream, const char* key) {
  const auto found = stream.find(key);
  if (found == stream.end()) return 0;
  if (found->is_number_integer()) return found->get<int>();
  int value = 0;
  if (found->is_string()) {
    const auto& digits = found->get_ref<const std::string&>();
    std::from_chars(digits.data(), digits.data() + digits.size(), value);
  }
  return value;
}

std::string word(const Json& stream, const char* key) {
  const auto found = stream.find(key);
  return found != stream.end() && found->is_string() ? found->get<std::string>().substr(0, 100) : "";
}

/// "4:3" -> 3/4: height of a pixel to its width.
double aspect_from(const std::string& ratio) {
  int across = 0, down = 0;
  const std::size_t colon = ratio.find(':');
  if (colon == ratio.npos) return 1;
  std::from_chars(ratio.data(), ratio.data() + colon, across);
  std::from_chars(ratio.data() + colon + 1, ratio.data() + ratio.size(), down);
  return across > 0 && down > 0 ? double(down) / across : 1;
}

void check_not_turned(const Json& stream, const std::string& origin) {
  const auto list = stream.find("side_data_list");
  if (list == stream.end() || !list->is_array()) return;
  for (const Json& item : *list)
    if (item.is_object() && whole(item, "rotation") != 0)
      throw BadInput(
          Reason::unsupported,
          fmt::format("{}: the film is to be shown turned by {} degrees, its pixels are not: export "
                      "its frames as images",
                      origin, whole(item, "rotation")));
}

[[noreturn]] void refuse_fields(const std::string& origin) {
  throw BadInput(
      Reason::unsupported,
      fmt::format("{}: the film is interlaced: each image has two moments, its odd and its even rows: "
                  "record it progressively, or export its fields as images",
                  origin));
}

void check_progressive(const Json& stream, const std::string& origin) {
  static constexpr std::array<std::string_view, 4> fields = {"tt", "bb", "tb", "bt"};
  if (std::ranges::find(fields, word(stream, "field_order")) != fields.end()) refuse_fields(origin);
}

/// The number behind "KEY=" in a line of ffprobe's compact writer.
int number_behind(std::string_view line, std::string_view key) {
  const std::size_t at = line.find(key);
  int value = 0;
  if (at != line.npos) std::from_chars(line.data() + at + key.size(), line.data() + line.size(), value);
  return value;
}

}  // namespace

void check_key_frames(const fs::path& path, std::string_view container, const FilmHeader& header) {
  const std::string origin = path.filename().string();
  std::vector<std::string> words = {"ffprobe",
                                    "-v",
                                    "error",
                                    "-select_streams",
                                    "v:0",
                                    "-skip_frame",
                                    "nokey",
                                    "-show_entries",
                                    "frame=width,height,interlaced_frame",
                                    "-of",
                                    "compact=p=0"};
  std::ranges::copy(film_input(path, container), std::back_inserter(words));
  ChildProgram probe(words);
  std::istringstream lines(all_output(probe));
  for (std::string line; std::getline(lines, line);) {
    if (number_behind(line, "interlaced_frame=") == 1) refuse_fields(origin);
    const int width = number_behind(line, "width="), height = number_behind(line, "height=");
    if (width > 0 && height > 0 && (width != header.width || height != header.height))
      throw BadInput(
          Reason::unsupported,
          fmt::format("{}: the size of its images changes from {} x {} to {} x {}: export its frames "
                      "as images and use those of one size",
                      origin, header.width, header.height, width, height));
  }
}

std::vector<std::string> film_input(const fs::path& path, std::string_view container) {
  // The name is a file's, and the container is stated: neither opens another file or an address.
  return {"-protocol_whitelist",  "file", "-f",
          std::string(container), "-i",   "file:" + fs::absolute(path).string()};
}

PixelLayout pixel_layout(const FilmHeader& header, const std::string& origin) {
  using Kind = PixelLayout::Kind;
  const std::string& format = header.pixel_format;
  if (const auto layout = luminance_layout(format, header.width, header.height)) return *layout;
  // Palettes and other orders of 8-bit colours: converting them changes no number.
  static constexpr std::array<std::string_view, 8> colours = {"rgb24", "bgr24", "gbrp", "pal8",
                                                              "bgr0",  "rgb0",  "0rgb", "0bgr"};
  if (std::ranges::find(colours, format) != colours.end()) return {Kind::triples, 8, "rgb24"};
  if (format == "yuyv422" || format == "uyvy422") {
    PixelLayout layout = *luminance_layout("yuv422p", header.width, header.height);
    layout.converted_to = "yuv422p";
    return layout;
  }
  if (format == "gray16be") return {Kind::luminance_first, 16, "gray16le"};
  throw BadInput(
      Reason::unsupported,
      fmt::format("{}: a film of pixel format \"{}\"; export its frames as grey images", origin, format));
}

FilmHeader read_film_header(const fs::path& path, std::string_view container) {
  const std::string origin = path.filename().string();
  std::vector<std::string> words = {"ffprobe",       "-v",  "error", "-select_streams", "v:0",
                                    "-show_streams", "-of", "json"};
  std::ranges::copy(film_input(path, container), std::back_inserter(words));
  ChildProgram probe(words);
  const std::string text = all_output(probe);
  const auto json = parse_json(text, origin);
  if (!probe.ended_well() || !json || !json->is_object() || !json->contains("streams") ||
      !(*json)["streams"].is_array() || (*json)["streams"].empty() || !(*json)["streams"][0].is_object())
    throw BadInput(Reason::not_an_image,
                   fmt::format("{}: no film that ffmpeg reads: {}", origin,
                               probe.first_error().empty() ? "it has no images" : probe.first_error()));
  const Json& stream = (*json)["streams"][0];
  FilmHeader header;
  header.width = whole(stream, "width");
  header.height = whole(stream, "height");
  if (const int frames = whole(stream, "nb_frames"); frames > 0) header.frames = frames;
  header.codec = word(stream, "codec_name");
  header.codec_name = word(stream, "codec_long_name");
  header.pixel_format = word(stream, "pix_fmt");
  header.pixel_aspect = aspect_from(word(stream, "sample_aspect_ratio"));
  check_not_turned(stream, origin);
  check_progressive(stream, origin);
  const auto pixels = std::size_t(std::max(header.width, 0)) * std::size_t(std::max(header.height, 0));
  if (pixels < 1 || header.width > int(image::max_image_side) || header.height > int(image::max_image_side) ||
      2 * pixels > image::max_image_bytes)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} x {} pixels, limit {} a side and {} bytes", origin, header.width,
                               header.height, image::max_image_side, image::max_image_bytes));
  return header;
}

bool is_lossless_film(const FilmHeader& header) {
  static constexpr std::array<std::string_view, 14> codecs = {
      "rawvideo", "ffv1", "huffyuv",  "ffvhuff", "utvideo", "lagarith", "png",
      "tiff",     "bmp",  "magicyuv", "zlib",    "msrle",   "qtrle",    "cscd"};
  return std::ranges::find(codecs, header.codec) != codecs.end();
}

}  // namespace helicarm::xray
