// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "helicarm/image/image.h"

namespace helicarm::simulation {

/// Logarithmic images: this fraction of the open beam is black.
inline constexpr double floor_signal = 0.004;

/// Detector parameters from the beam behind the patient to the stored grey values.
struct Imaging {
  double quanta_per_pixel = 1000;  ///< mean over the field: set point of the automatic exposure control
  double electronic_noise = 0.8;   ///< rms, in quanta
  double scatter_fraction = 0.1;   ///< scattered over primary signal, locally
  double scatter_sigma_px = 110;
  double focus_sigma_px = 0.6;    ///< penumbra of the focal spot
  double screen_sigma_px = 0.65;  ///< light spread in the screen: blurs the quantum noise too
  double vignette = 0.2;          ///< fall-off of the light from the centre to the field's edge
  double field_radius_px = 504;
  bool logarithmic = false;  ///< grey value is the logarithm of the signal
  int bits = 12;
  double open_level = 0.86;  ///< grey value of the open beam relative to full scale; above 1 it saturates
};

/// Expected light on the screen.
struct Light {
  image::Image<float> level;  ///< open beam, without scatter = 1
  double quanta;              ///< per pixel at level 1
};

/// Adds the focal spot's penumbra and scatter to a noise-free image (open beam = 1).
Light illuminate(const image::Image<float>& signal, const Imaging& imaging);

/// Grey values of a noise-free image (open beam = 1). `stream` separates views of one seed. The result does
/// not depend on `threads` (0: all cores).
image::Image<std::uint16_t> detector_response(const image::Image<float>& signal, const Imaging& imaging,
                                              std::uint64_t seed, std::uint32_t stream, unsigned threads = 0);

/// Mirrors the image left to right.
template <class T>
image::Image<T> mirrored(const image::Image<T>& image) {
  image::Image<T> mirror(image.width(), image.height());
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) mirror(u, v) = image(image.width() - 1 - u, v);
  return mirror;
}

}  // namespace helicarm::simulation
