// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm {

/// What a study had done when it stopped.
struct JournalContent {
  struct Block {
    std::size_t number;
    std::vector<double> values;
  };
  std::vector<std::vector<double>> settled;  ///< of the settings that are over
  std::vector<Block> blocks;                 ///< of the next setting
};

/// A file of records, each with its check sum: those that are whole survive a kill at any moment. A setting
/// that is over replaces the file as a whole; blocks are appended.
class Journal {
 public:
  Journal(std::filesystem::path path, std::string identity);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// What the file holds; nothing where there is none. A torn end is left out. Another study's is bad_value.
  Expected<JournalContent> read() const;
  /// Begins the file anew with this content.
  Expected<void> write(const JournalContent& content);
  Expected<void> append(std::size_t block, std::span<const double> values);

 private:
  std::filesystem::path path_;
  std::string identity_;
  int file_ = -1;
};

}  // namespace helicarm
