// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/exchange/import_matrix.h"

namespace helicarm::exchange {

/// A file that lasts as long as the object.
class WrittenFile {
 public:
  explicit WrittenFile(const std::string& text)
      : path(std::filesystem::temp_directory_path() /
             ("helicarm_import_" + std::to_string(::getpid()) + ".txt")) {
    EXPECT_TRUE(write_file(path, text));
  }
  ~WrittenFile() { std::filesystem::remove(path); }
  WrittenFile(const WrittenFile&) = delete;
  WrittenFile& operator=(const WrittenFile&) = delete;

  const std::filesystem::path path;
};

inline Expected<ImportedMatrix> import_text(const std::string& text, const ImportOptions& options = {}) {
  return import_matrix(WrittenFile(text).path, options);
}

inline std::string replaced(std::string text, const std::string& what, const std::string& by) {
  return text.replace(text.find(what), what.size(), by);
}

}  // namespace helicarm::exchange
