// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/track/smooth.h"

namespace helicarm::track {

enum class MarkerStatus { tracked, one_view, predicted, lost };
inline constexpr std::array<std::string_view, 4> status_words{"tracked", "one_view", "predicted", "lost"};

enum class PoseDecision { accept, warn, refuse };
inline constexpr std::array<std::string_view, 3> decision_words{"accept", "warn", "refuse"};

/// A marker in one frame.
struct TrackedMarker {
  MarkerStatus status = MarkerStatus::lost;
  std::optional<FramePlace> place;  ///< world, mm; nothing: lost
  std::optional<double> ray_gap_mm;
  std::vector<std::size_t> views;  ///< that show it
};

/// A body in one frame, against the first frame.
struct TrackedBody {
  PoseDecision decision = PoseDecision::refuse;
  std::optional<FramePose> pose;  ///< world_from_body; covariance about `centre`
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::optional<int> markers = 0;  ///< that determined it; nothing: a model
  std::optional<double> rms_mm;    ///< of those seen in two views about their places in the body
  std::optional<Reason> reason;
};

}  // namespace helicarm::track
