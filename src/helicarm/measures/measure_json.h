// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/json.h"
#include "helicarm/measures/measure.h"

namespace helicarm::measures {

/// { "kind", "depth_mm", "quantities": [{ "name", "unit", "value", "sigma" }],
///   "positions": [{ "point", "percent": { component: value }, "covariance_percent2" }] }
Json to_json(const Measure& measure);

/// A quantity or position in a line, with its standard deviation: "length 43.21 mm, sigma 0.12",
/// "FS depth 27.3 %, sigma 0.6; height 31.2 %, sigma 0.9".
std::string sentence_of(const Quantity& quantity);
std::string sentence_of(Kind kind, const Position& position);

}  // namespace helicarm::measures
