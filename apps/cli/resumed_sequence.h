// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <fmt/format.h>

#include "command.h"

namespace helicarm::cli {

/// Prints what a resumed sequence computes again.
inline std::function<void(const std::string&)> noted(Console& console) {
  return [&console](const std::string& text) {
    if (!console.quiet) console.progress << fmt::format("\nhelicarm: {}\n", text) << std::flush;
  };
}

/// What an interrupted sequence keeps, and the command that goes on.
inline std::string kept_after_interruption(const std::string& command, const std::filesystem::path& folder,
                                           const std::string& frames, const std::filesystem::path& out,
                                           int done, int all) {
  const auto quoted = [](const std::string& word) {
    return word.find_first_of(" '\"\\$&();*?") == word.npos ? word : fmt::format("'{}'", word);
  };
  return fmt::format(
      "\nhelicarm: interrupted: {} of {} frames are kept in {}; go on with\n  helicarm {} {} --frames {} "
      "--out {} "
      "--resume\n",
      done, all, out.string(), command, quoted(folder.string()), frames, quoted(out.string()));
}

}  // namespace helicarm::cli
