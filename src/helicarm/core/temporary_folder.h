// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/core/system_message.h"

namespace helicarm {

/// A new folder in the system's temporary folder, removed with its content on destruction.
class TemporaryFolder {
 public:
  /// Throws BadInput (cannot_write).
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "helicarm_XXXXXX").string();
    if (!::mkdtemp(name.data()))
      throw BadInput(Reason::cannot_write, name + ": cannot be created: " + system_message(errno));
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace helicarm
