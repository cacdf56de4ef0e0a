// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::xray {

/// A film (AVI, MP4, QuickTime, Matroska, Windows Media, MPEG), which the program ffmpeg decodes in a process
/// of its own, frame by frame from the first on: no frame is found by seeking. Grey values are those that the
/// film stores, its luminance where its chrominance is neutral. Opening decodes it once to the end.
class Film {
 public:
  /// The film of the file, opened once while few others are; nothing where the file begins as no film does.
  /// Throws BadInput: not_an_image without ffmpeg, or where it finds no film; truncated where fewer frames
  /// can be decoded than the file declares; bad_size; unsupported for a film that is to be turned.
  static std::shared_ptr<const Film> at(const std::filesystem::path& path);
  ~Film();

  int frames() const;
  /// What the decoding loses, or nothing: "Motion JPEG compresses with loss".
  std::optional<std::string> loss() const;
  /// Bits of a grey value, 8 to 16.
  int bits() const;
  /// By its index from 0. Indices that do not grow start the decoder again. Throws BadInput: unsupported for
  /// a frame in colour; as `at` where the file has changed. Thread-safe.
  image::GreyImage read(int index) const;

 private:
  struct Decoding;
  explicit Film(std::unique_ptr<Decoding> decoding);
  std::unique_ptr<Decoding> decoding_;
};

}  // namespace helicarm::xray
