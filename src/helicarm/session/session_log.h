// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm {

/// One thing that happened in an operation.
struct SessionRecord {
  std::uint64_t number;  ///< from 0
  double time_s;         ///< UTC, seconds since 1970
  std::string kind;      ///< exposure, pose, decision, order, ...
  Json content;
};

struct SessionHistory {
  std::vector<SessionRecord> records;
  std::size_t whole_bytes = 0;  ///< of the file: up to the last whole record
  bool torn = false;            ///< the program was killed while it wrote the next one, which is left out
};

/// Reads a log. Each line is the record's JSON after the SHA-256 of the digits before and this JSON, so
/// that nothing can be changed, lost or exchanged in between unseen. Refuses: missing_file, unsupported
/// (another format), bad_value (names the line that does not belong), and as `parse_json`.
Expected<SessionHistory> read_session(const std::filesystem::path& log);

/// The record of an operation: lines are only ever appended, and each is on disk when `append` returns. Safe
/// to call from several threads. Patient data do not belong here: images are named by their digests.
class SessionLog {
 public:
  /// Goes on with the log that is there (cutting off a torn end) or begins one. Refuses cannot_write, also
  /// when another program writes it, and as `read_session`.
  static Expected<std::unique_ptr<SessionLog>> open(const std::filesystem::path& log);
  ~SessionLog();
  SessionLog(const SessionLog&) = delete;
  SessionLog& operator=(const SessionLog&) = delete;

  /// Refuses cannot_write, and bad_json for content that `parse_json` would not read again; then it leaves
  /// the log as it was: what cannot be recorded must not be done.
  Expected<void> append(const std::string& kind, Json content);

  /// What the log held when it was opened.
  const SessionHistory& history() const { return history_; }

 private:
  SessionLog(std::filesystem::path log, int file) : log_(std::move(log)), file_(file) {}

  std::filesystem::path log_;
  int file_;
  SessionHistory history_;
  std::mutex mutex_;
  std::string chain_;
  std::uint64_t next_ = 0;
  std::size_t size_ = 0;
};

}  // namespace helicarm
