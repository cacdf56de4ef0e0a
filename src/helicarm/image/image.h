// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace helicarm::image {

/// Pixel matrix, row major, without padding. Pixel (0, 0) is the centre of the top-left pixel; u (column) to
/// the right, v (row) down. A value type: deep copy, cheap move.
template <class T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, T fill = T{})
      : width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return pixels_.empty(); }
  bool contains(int u, int v) const { return u >= 0 && v >= 0 && u < width_ && v < height_; }

  T& operator()(int u, int v) { return pixels_[index(u, v)]; }
  const T& operator()(int u, int v) const { return pixels_[index(u, v)]; }
  T* row(int v) { return pixels_.data() + index(0, v); }
  const T* row(int v) const { return pixels_.data() + index(0, v); }
  std::span<T> pixels() { return pixels_; }
  std::span<const T> pixels() const { return pixels_; }

 private:
  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> pixels_;
};

}  // namespace helicarm::image
