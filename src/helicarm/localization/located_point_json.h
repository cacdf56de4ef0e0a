// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/json.h"
#include "helicarm/localization/locate.h"

namespace helicarm::localization {

/// An element of a result's "points", in the calibrator's frame. Positions in bones and tool are null;
/// guidance sets them.
Json point_json(const LocatedPoint& located_in_calibrator);

/// The same without covariance, predicted error and 95 % length.
Json point_json_without_covariance(const LocatedPoint& located_in_calibrator);

/// A point that was not located, with the reason.
Json point_json(const std::string& name, PointSource source, Reason reason);

}  // namespace helicarm::localization
