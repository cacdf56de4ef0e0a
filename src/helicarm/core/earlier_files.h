// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace helicarm {

/// Removes files of an earlier run, which could be taken for those of this one; call it before anything can
/// fail. Files of other names, folders, and files that this run reads (`inputs`) stay.
inline void forget_files(const std::filesystem::path& folder, std::span<const std::string> names,
                         std::span<const std::filesystem::path> inputs = {}) {
  for (const std::string& name : names) {
    std::error_code ignored;
    const std::filesystem::path file = folder / name;
    if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(file, ignored)) &&
        !std::filesystem::is_symlink(file, ignored))
      continue;
    bool is_read = false;
    for (const std::filesystem::path& input : inputs)
      is_read = is_read || std::filesystem::equivalent(file, input, ignored);
    if (!is_read) std::filesystem::remove(file, ignored);
  }
}
inline void forget_files(const std::filesystem::path& folder, const std::vector<std::string>& names,
                         const std::vector<std::filesystem::path>& inputs = {}) {
  forget_files(folder, std::span(names), std::span(inputs));
}

}  // namespace helicarm
