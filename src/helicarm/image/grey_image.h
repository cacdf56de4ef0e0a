// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "helicarm/image/image.h"

namespace helicarm::image {

/// Limits for every image file.
inline constexpr std::uint32_t max_image_side = 16384;
inline constexpr std::size_t max_image_bytes = std::size_t{256} << 20;

/// A decoded grey image: values as stored, 0 .. 2^bits - 1.
struct GreyImage {
  Image<std::uint16_t> pixels;
  int bits = 8;                ///< 8 or 16
  double pixel_aspect = 1;     ///< height of a pixel to its width, as the file declares it
  bool white_is_zero = false;  ///< the file declares that 0 is displayed as white
};

}  // namespace helicarm::image
