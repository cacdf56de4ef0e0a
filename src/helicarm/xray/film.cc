// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/film.h"

#include <algorithm>
#include <array>
#include <deque>
#include <fstream>
#include <mutex>

#include <fmt/format.h>

#include "helicarm/xray/child_program.h"
#include "helicarm/xray/film_header.h"
#include "helicarm/xray/foreign_file.h"

namespace helicarm::xray {
namespace {

namespace fs = std::filesystem;

std::size_t bytes_of_frame(const PixelLayout& layout, int width, int height) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  if (layout.kind == PixelLayout::Kind::triples) return 3 * pixels;
  return (pixels + layout.chrominance) * (layout.bits > 8 ? 2 : 1);
}

[[noreturn]] void refuse_colour(const std::string& origin, int index) {
  throw BadInput(Reason::unsupported,
                 fmt::format("{}: frame {} is a colour image; convert it to grey", origin, index + 1));
}

std::uint16_t sample_at(const std::vector<char>& bytes, std::size_t at, bool wide) {
  if (!wide) return static_cast<unsigned char>(bytes[at]);
  return std::uint16_t(static_cast<unsigned char>(bytes[2 * at]) |
                       static_cast<unsigned char>(bytes[2 * at + 1]) << 8);
}

image::GreyImage grey_frame(const std::vector<char>& bytes, const PixelLayout& layout,
                            const FilmHeader& header, const std::string& origin, int index) {
  image::GreyImage grey{{header.width, header.height}, layout.bits > 8 ? 16 : 8, header.pixel_aspect};
  const auto pixels = grey.pixels.pixels();
  if (layout.kind == PixelLayout::Kind::luminance_first) {
    const bool wide = layout.bits > 8;
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = sample_at(bytes, i, wide);
    const int neutral = 1 << (layout.bits - 1);
    for (std::size_t i = 0; i < layout.chrominance; ++i)
      if (sample_at(bytes, pixels.size() + i, wide) != neutral) refuse_colour(origin, index);
    return grey;
  }
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const char* at = bytes.data() + 3 * i;
    if (at[0] != at[1] || at[0] != at[2]) refuse_colour(origin, index);
    pixels[i] = static_cast<unsigned char>(*at);
  }
  return grey;
}

}  // namespace

struct Film::Decoding {
  fs::path path;
  std::string origin, container;
  FilmHeader header;
  PixelLayout layout;
  int frames = 0;
  std::mutex mutex;
  std::unique_ptr<ChildProgram> decoder;
  int next = 0;  ///< index of the decoder's next frame
  std::deque<std::pair<int, image::GreyImage>> recent;
  std::vector<char> bytes;

  void begin() {
    std::vector<std::string> words = {"ffmpeg",      "-v",      "error",    "-nostdin", "-xerror",
                                      "-err_detect", "explode", "-threads", "1",        "-noautorotate"};
    std::ranges::copy(film_input(path, container), std::back_inserter(words));
    for (const char* each : {"-map", "0:v:0", "-an", "-vsync", "passthrough"}) words.emplace_back(each);
    if (!layout.converted_to.empty()) {
      words.emplace_back("-pix_fmt");
      words.push_back(layout.converted_to);
    }
    for (const char* each : {"-f", "rawvideo", "pipe:1"}) words.emplace_back(each);
    decoder = std::make_unique<ChildProgram>(words);
    next = 0;
    bytes.resize(bytes_of_frame(layout, header.width, header.height));
  }

  [[noreturn]] void refuse_end() const {
    const std::string why = decoder->first_error();
    throw BadInput(
        {Reason::truncated,
         fmt::format("{}: frame {}{} cannot be decoded{}{}: copy the film again, or export the frames that "
                     "are whole as images",
                     origin, next + 1, header.frames ? fmt::format(" of {}", *header.frames) : "",
                     why.empty() ? "" : ": ", why),
         {},
         {{"frame", double(next + 1)}}});
  }

  /// The decoder's next frame, into `bytes`; false at the end of the film.
  bool take() {
    const std::size_t got = decoder->read(bytes);
    if (got == bytes.size()) {
      ++next;
      return true;
    }
    if (got > 0 || !decoder->ended_well()) refuse_end();
    return false;
  }

  void count() {
    begin();
    while (take()) {
    }
    frames = next;
    // Without a declared number an error that ended nothing is the only sign of frames that are missing.
    if (frames == 0 || (header.frames ? frames < *header.frames : !decoder->first_error().empty()))
      refuse_end();
    decoder.reset();
  }

  image::GreyImage at(int index) {
    const std::lock_guard lock(mutex);
    for (const auto& [of, kept] : recent)
      if (of == index) return kept;
    if (!decoder || index < next) begin();
    while (next <= index)
      if (!take()) refuse_end();
    constexpr std::size_t most_kept = 2;
    if (recent.size() == most_kept) recent.pop_front();
    return recent.emplace_back(index, grey_frame(bytes, layout, header, origin, index)).second;
  }
};

Film::Film(std::unique_ptr<Decoding> decoding) : decoding_(std::move(decoding)) {}
Film::~Film() = default;

std::shared_ptr<const Film> Film::at(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return nullptr;
  std::array<char, 32> head{};
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), head.size());
  const std::string_view first(head.data(), std::size_t(file.gcount()));
  const std::string_view container = film_container(first);
  if (container.empty()) return nullptr;

  struct Opened {
    fs::path path;
    std::uintmax_t size;
    fs::file_time_type written;
    std::shared_ptr<const Film> film;
  };
  static std::mutex mutex;
  static std::deque<Opened> opened;  // To count a film's frames takes as long as to decode it.
  const std::lock_guard lock(mutex);
  const Opened now{fs::absolute(path, error), fs::file_size(path, error), fs::last_write_time(path, error),
                   nullptr};
  for (const Opened& each : opened)
    if (each.path == now.path && each.size == now.size && each.written == now.written) return each.film;
  auto decoding = std::make_unique<Decoding>();
  decoding->path = path;
  decoding->origin = path.filename().string();
  decoding->container = container;
  try {
    decoding->header = read_film_header(path, container);
    if (decoding->header.pixel_format.empty())
      throw BadInput({Reason::truncated,
                      fmt::format("{}: frame 1 cannot be decoded: copy the film again", decoding->origin),
                      {},
                      {{"frame", 1}}});
    decoding->layout = pixel_layout(decoding->header, decoding->origin);
    if (!is_lossless_film(decoding->header)) check_key_frames(path, container, decoding->header);
    decoding->count();
  } catch (const BadInput& bad) {
    if (bad.failure().reason != Reason::missing_file) throw;
    throw BadInput(Reason::not_an_image, fmt::format("{}: {}", decoding->origin, *foreign_file(first)));
  }
  constexpr std::size_t most_opened = 4;
  if (opened.size() == most_opened) opened.pop_front();
  opened.push_back(now);
  opened.back().film = std::shared_ptr<const Film>(new Film(std::move(decoding)));
  return opened.back().film;
}

int Film::frames() const { return decoding_->frames; }

int Film::bits() const { return decoding_->layout.bits; }

std::optional<std::string> Film::loss() const {
  const FilmHeader& header = decoding_->header;
  if (is_lossless_film(header)) return std::nullopt;
  return fmt::format("{} compresses a film with loss ({} frames of {} x {} pixels, {} bits)",
                     header.codec_name.empty() ? header.codec : header.codec_name, decoding_->frames,
                     header.width, header.height, bits());
}

image::GreyImage Film::read(int index) const { return decoding_->at(index); }

}  // namespace helicarm::xray
