// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace helicarm::cli {

/// One of the words, which the message lists.
inline CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& word) -> std::string {
    if (std::ranges::count(words, word) > 0) return {};
    return fmt::format("\"{}\" is none of: {}", word, fmt::join(words, ", "));
  };
  return {check, fmt::format("{{{}}}", fmt::join(words, ", "))};
}

}  // namespace helicarm::cli
