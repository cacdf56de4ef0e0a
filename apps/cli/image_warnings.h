// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <fmt/format.h>

#include "command.h"
#include "helicarm/core/json.h"

namespace helicarm::cli {

/// What a reader says of an image, each on a line of the progress stream.
inline void print_warnings(const std::vector<Warning>& warnings, Console& console) {
  if (console.quiet) return;
  for (const Warning& warning : warnings) {
    const bool named = warning.view.empty() || warning.message.starts_with(warning.view);
    console.progress << fmt::format("helicarm: warning: {}: {}{}{}\n", code(warning.reason),
                                    named ? "" : warning.view, named ? "" : ": ", warning.message);
  }
}

/// The same for --json, with the keys of result.json.
inline Json json_of_warnings(const std::vector<Warning>& warnings) {
  Json list = Json::array();
  for (const Warning& warning : warnings)
    list.push_back({{"code", code(warning.reason)},
                    {"message", warning.message},
                    {"view", warning.view.empty() ? Json() : Json(warning.view)},
                    {"figures", warning.figures}});
  return list;
}

}  // namespace helicarm::cli
