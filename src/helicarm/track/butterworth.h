// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace helicarm::track {

/// Low-pass filter of motion laboratories, forwards and backwards, without a lag.
struct Butterworth {
  double cut_off_hz = 0;  ///< at which both passes together leave 1 / sqrt(2) of the amplitude
  int order = 4;          ///< of both passes together: 2 or 4
};

/// The filtered places, mm; each run of frames with a place by itself, its ends reflected about their points.
/// `rate_hz`: of the frames, more than twice the cut-off.
std::vector<std::optional<Eigen::Vector3d>> butterworth_filtered(
    const std::vector<std::optional<Eigen::Vector3d>>& places, double rate_hz, const Butterworth& filter);

}  // namespace helicarm::track
