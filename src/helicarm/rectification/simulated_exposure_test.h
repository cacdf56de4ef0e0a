// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "helicarm/simulation/simulate_case.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

/// For tests: a simulated picture as the reader would hand it over, without the detour through a file.
inline Exposure exposure_of(const simulation::SimulatedView& view) {
  Exposure exposure;
  exposure.name = view.shot.name;
  exposure.pixels = Image<float>(view.pixels.width(), view.pixels.height());
  std::copy(view.pixels.pixels().begin(), view.pixels.pixels().end(), exposure.pixels.pixels().begin());
  exposure.highest = static_cast<float>((1 << view.shot.imaging.bits) - 1);
  exposure.acquisition.pixel_mm = Eigen::Vector2d::Constant(view.shot.pixel_mm());
  exposure.acquisition.source_detector_mm = view.shot.nominal_f_mm;
  exposure.acquisition.logarithmic = view.shot.imaging.logarithmic;
  return exposure;
}

/// A case of 512 pixels a side.
inline simulation::SimulatedCase small_case(std::uint64_t seed, simulation::CaseKind kind,
                                            std::vector<simulation::Fault> faults = {},
                                            std::vector<std::string> lost_balls = {}) {
  simulation::SimulationOptions options;
  options.seed = seed;
  options.kind = kind;
  options.size = 512;
  options.faults = std::move(faults);
  options.lost_balls = std::move(lost_balls);
  return simulation::simulate_case(options).value();
}

}  // namespace helicarm
