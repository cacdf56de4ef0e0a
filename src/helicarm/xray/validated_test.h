// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>

#include <fmt/format.h>

#include "helicarm/core/files.h"

namespace helicarm::xray {

/// Lines with an error of dicom3tools' validator; nothing where it is not installed.
inline std::optional<std::string> validated(const std::filesystem::path& file) {
  if (std::system("command -v dciodvfy >/dev/null 2>&1") != 0) return {};
  const std::string log = file.string() + ".log";
  if (std::system(fmt::format("dciodvfy '{}' >'{}' 2>&1", file.string(), log).c_str()) == -1) return {};
  std::istringstream lines(*read_file(log, 1 << 20));
  std::string errors;
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("Error")) errors += line + '\n';
  return errors;
}

}  // namespace helicarm::xray
