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

namespace helicarm::operation {

/// One event of an operation.
struct SessionRecord {
  std::uint64_t number;  ///< from 0
  double time_s;         ///< UTC, seconds since 1970
  std::string kind;      ///< exposure, pose, decision, order, ...
  Json content;
};

struct SessionHistory {
  std::vector<SessionRecord> records;
  std::size_t whole_bytes = 0;  ///< length of the file up to the last complete record
  bool torn =
      false;  ///< an incomplete record follows, which is left out: the program was killed while writing
};

/// Reads a log. Each line holds the record's JSON after the SHA-256 of the previous digest and this JSON, so
/// a changed, missing or exchanged line is detected. Refuses: missing_file, unsupported (another format),
/// bad_value (with the line), and as `parse_json`.
Expected<SessionHistory> read_session(const std::filesystem::path& log);

/// The record of an operation: append-only; each record is on disk, in the file of this name, when `append`
/// returns. Thread-safe. Must not contain patient data: images are identified by their digests.
class SessionLog {
 public:
  /// Continues an existing log (and removes an incomplete last record) or begins one. Refuses cannot_write,
  /// also if another program has it open, and as `read_session`.
  static Expected<std::unique_ptr<SessionLog>> open(const std::filesystem::path& log);
  ~SessionLog();
  SessionLog(const SessionLog&) = delete;
  SessionLog& operator=(const SessionLog&) = delete;

  /// Refuses as `intact`, cannot_write, and bad_json for content that `parse_json` could not read back; the
  /// log is then unchanged. An action that cannot be recorded must not be carried out.
  Expected<void> append(const std::string& kind, Json content);

  /// Whether the file of this name is still the one that was opened and holds what was appended, nothing else
  /// (record_lost). Costs two system calls, so that it may be polled while a robot moves.
  Expected<void> intact();

  /// Content of the log when it was opened.
  const SessionHistory& history() const { return history_; }

 private:
  SessionLog(std::filesystem::path log, int file) : log_(std::move(log)), file_(file) {}

  Expected<void> check_file();

  std::filesystem::path log_;
  int file_;
  SessionHistory history_;
  std::mutex mutex_;
  std::string chain_;
  std::uint64_t next_ = 0;
  std::size_t size_ = 0;
  std::int64_t written_ns_ = 0;  ///< time of the file's last change by this program
};

}  // namespace helicarm::operation
