// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace helicarm::cli {

/// The names, numbered where they repeat: knee, knee_2, knee_3.
inline std::vector<std::string> distinct(const std::vector<std::string>& names) {
  std::vector<std::string> all;
  for (const std::string& name : names) {
    std::string own = name;
    for (int n = 2; std::ranges::find(all, own) != all.end(); ++n) own = fmt::format("{}_{}", name, n);
    all.push_back(own);
  }
  return all;
}

}  // namespace helicarm::cli
