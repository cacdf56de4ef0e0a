// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/failure.h"

namespace helicarm::cli {

/// The files, and in their names' order those of the folders. Throws BadInput (missing_file) for a folder
/// without files.
inline std::vector<std::filesystem::path> image_files(const std::vector<std::filesystem::path>& images) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path& image : images) {
    if (!std::filesystem::is_directory(image)) {
      files.push_back(image);
      continue;
    }
    std::vector<std::filesystem::path> inside;
    for (const auto& entry : std::filesystem::directory_iterator(image))
      if (entry.is_regular_file() && !entry.path().filename().string().starts_with('.') &&
          entry.path().extension() != ".json")  // sidecars
        inside.push_back(entry.path());
    if (inside.empty())
      throw BadInput(Reason::missing_file, fmt::format("{}: the folder holds no file", image.string()));
    std::ranges::sort(inside);
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

}  // namespace helicarm::cli
