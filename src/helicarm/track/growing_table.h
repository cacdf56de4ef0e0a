// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/core/system_message.h"

namespace helicarm::track {

/// A table that grows by rows, each of which is in the file when `add` returns.
class GrowingTable {
 public:
  /// Begins the file anew. Throws BadInput: cannot_write.
  GrowingTable(const std::filesystem::path& path, const std::string& header)
      : path_(path), file_(path, std::ios::binary) {
    add(header);
  }
  void add(const std::string& rows) {
    file_ << rows << std::flush;
    if (!file_)
      throw BadInput(Reason::cannot_write, path_.string() + ": cannot be written: " + system_message(errno));
  }

 private:
  std::filesystem::path path_;
  std::ofstream file_;
};

}  // namespace helicarm::track
