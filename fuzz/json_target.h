// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/json.h"
#include "target.h"

namespace helicarm::fuzz {

/// Whether all numbers are finite.
bool all_finite(const Json& json);

/// Parses an input, reads it with `read(json)`, and checks the round trip: accepted data, written by `write`
/// as JSON, read back equal.
template <class Read, class Write>
void run_round_trip(std::string_view bytes, const Read& read, const Write& write) {
  const auto json = parse_json(bytes, "input.json");
  if (!json) return;
  const auto value = read(*json);
  if (!value) return;
  const Json written = write(*value);
  check(all_finite(written), "accepted numbers are finite");
  const auto parsed = parse_json(to_text(written), "written.json");
  check(parsed.has_value(), "written data are valid JSON");
  const auto again = read(*parsed);
  check(again.has_value(), "written data are accepted");
  check(write(*again) == written, "written data read back equal");
}

}  // namespace helicarm::fuzz
