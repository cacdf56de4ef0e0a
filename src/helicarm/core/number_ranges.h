// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace helicarm {

/// "4-6, 9" of ascending numbers; after `most` parts "...".
inline std::string number_ranges(const std::vector<int>& numbers, std::size_t most = 30) {
  std::string text;
  std::size_t parts = 0;
  for (std::size_t i = 0; i < numbers.size(); ++parts) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += parts == 0 ? "" : ", ";
    if (parts == most) return text + "...";
    text += last == i ? fmt::format("{}", numbers[i]) : fmt::format("{}-{}", numbers[i], numbers[last]);
    i = last + 1;
  }
  return text;
}

}  // namespace helicarm
