// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/json.h"

namespace helicarm::phantom {

/// Limits of a calibrator's numbers, from files and from arrays.
inline constexpr Range coordinate_range{-1000, 1000};  ///< mm
inline constexpr Range diameter_range{0.5, 30};        ///< mm
inline constexpr Range tolerance_range{0, 1};          ///< mm
inline constexpr Range scale_sigma_range{0, 0.1};      ///< relative
inline constexpr double least_extent_mm = 10;          ///< below it the unit is wrong
inline constexpr double least_distance_mm = 0.1;       ///< of two balls

}  // namespace helicarm::phantom
