// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm::study {

/// State of an interrupted study.
struct JournalContent {
  struct Block {
    std::size_t number;
    std::vector<double> values;
  };
  std::vector<std::vector<double>> settled;  ///< of the finished settings
  std::vector<Block> blocks;                 ///< of the current setting
};

/// A file of records with checksums: complete records survive a kill at any time. A finished setting replaces
/// the file as a whole; blocks are appended.
class Journal {
 public:
  Journal(std::filesystem::path path, std::string identity);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Content of the file; empty without a file. An incomplete end is left out. A journal of another study is
  /// bad_value.
  Expected<JournalContent> read() const;
  /// Rewrites the file with this content.
  Expected<void> write(const JournalContent& content);
  Expected<void> append(std::size_t block, std::span<const double> values);

 private:
  std::filesystem::path path_;
  std::string identity_;
  int file_ = -1;
};

}  // namespace helicarm::study
