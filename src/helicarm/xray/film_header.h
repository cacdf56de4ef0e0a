// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace helicarm::xray {

/// How the decoder writes a frame.
struct PixelLayout {
  enum class Kind { luminance_first, triples };
  Kind kind = Kind::luminance_first;
  int bits = 8;
  std::string converted_to = {};  ///< for ffmpeg's -pix_fmt; empty: as stored
  std::size_t chrominance = 0;    ///< numbers behind the luminance
};

/// What ffprobe states of a film's images.
struct FilmHeader {
  int width = 0, height = 0;
  std::optional<int> frames;
  std::string codec, codec_name, pixel_format;
  double pixel_aspect = 1;
};

/// Arguments of ffmpeg and ffprobe that name the film, so that it opens no other file and no address.
std::vector<std::string> film_input(const std::filesystem::path& path, std::string_view container);

/// Throws BadInput: missing_file without ffprobe, not_an_image, bad_size, unsupported for a film to be
/// turned and for one that is interlaced.
FilmHeader read_film_header(const std::filesystem::path& path, std::string_view container);

/// Throws BadInput (unsupported) for interlaced frames and for frames of another size; only frames that are
/// coded by themselves can differ.
void check_key_frames(const std::filesystem::path& path, std::string_view container,
                      const FilmHeader& header);

/// Throws BadInput (unsupported) for pixel formats whose grey values would change.
PixelLayout pixel_layout(const FilmHeader& header, const std::string& origin);

bool is_lossless_film(const FilmHeader& header);

}  // namespace helicarm::xray
