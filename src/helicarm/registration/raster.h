// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/geometry/view.h"
#include "helicarm/image/image.h"

namespace helicarm::registration {

/// A view to which models are registered.
struct RegistrationView {
  std::string name;
  geometry::View view;       ///< world to the image's (rectified) pixels
  image::Image<float> grey;  ///< rectified; metal dark
  float lowest = 0;          ///< grey values that the file can store
  float highest = 4095;
  bool logarithmic = false;           ///< grey value is the logarithm of the dose
  image::Image<std::uint8_t> usable;  ///< 0 where fiducials, plate dots or tools are; empty: all usable
  /// Of the view's parameters, as `calibration::CalibratedView`. Nothing: the camera is taken as exact.
  std::optional<calibration::ViewCovariance> covariance;
};

/// Attenuation (logarithm of the grey value, increasing with matter) at 1 / `factor` of the resolution.
struct Raster {
  int factor = 1;
  image::Image<float> attenuation;
  image::Image<std::uint8_t> valid;

  /// Full-resolution pixel of a raster position, and back.
  Eigen::Vector2d pixel_at(const Eigen::Vector2d& at) const {
    return factor * at + Eigen::Vector2d::Constant(0.5 * (factor - 1));
  }
  Eigen::Vector2d raster_at(const Eigen::Vector2d& pixel) const {
    return (pixel - Eigen::Vector2d::Constant(0.5 * (factor - 1))) / factor;
  }
};

/// The usable part of the attenuation image: without what `usable` excludes and the black surround of the
/// field with a margin.
Raster attenuation_raster(const RegistrationView& view);

/// Means over the valid pixels of blocks; a block is valid if more than half of its pixels are.
Raster coarser(const Raster& full, int factor);

}  // namespace helicarm::registration
