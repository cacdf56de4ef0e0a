// SPDX-License-Identifier: Apache-2.0
#include "json_target.h"

#include <algorithm>
#include <cmath>

namespace helicarm::fuzz {

bool all_finite(const Json& json) {
  if (json.is_number_float()) return std::isfinite(json.get<double>());
  return !json.is_structured() || std::all_of(json.begin(), json.end(), all_finite);
}

}  // namespace helicarm::fuzz
