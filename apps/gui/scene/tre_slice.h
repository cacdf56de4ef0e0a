// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "helicarm/localization/tre_volume.h"

namespace helicarm::gui {

enum class SliceAxis { x, y, z };

/// The predicted TRE on a plane perpendicular to an axis of the calibrator, `side` x `side` points.
struct TreSlice {
  int side;
  std::vector<Eigen::Vector3d> places;
  std::vector<double> rms_mm;  ///< NaN: no point can be located there
};

/// Interpolated between two layers of the volume; beyond the volume its last layer is used.
TreSlice slice_of(const localization::TreVolume& volume, SliceAxis axis, double place_mm);

/// Ends of the colour bar and distance of its ticks, mm.
struct TreScale {
  double low;
  double high;
  double step;
  double share(double value) const { return (value - low) / (high - low); }
};

/// Over the whole volume, so that slices are comparable.
TreScale scale_of(const localization::TreVolume& volume);

using Colour = std::array<std::uint8_t, 3>;

/// Violet, blue, green, yellow: equal steps of lightness and hue, distinguishable with colour blindness.
/// Argument 0 to 1.
Colour colour_of(double share);

}  // namespace helicarm::gui
