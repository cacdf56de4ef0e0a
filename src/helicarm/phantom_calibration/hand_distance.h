// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <variant>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::phantom_calibration {

/// A fiducial by its label, or by a raw pixel in the first view.
using FiducialName = std::variant<std::string, Eigen::Vector2d>;

struct HandDistance {
  FiducialName a, b;
  double mm;
};

/// A,B=MM with labels, or u1,v1;u2,v2=MM. `usage` where it is neither.
Expected<HandDistance> hand_distance_from(const std::string& text);

/// Whether the word for a distance's kind is "outer" (over both balls) and not "centres"; `usage` for
/// another.
Expected<bool> is_outer(const std::string& word);

}  // namespace helicarm::phantom_calibration
