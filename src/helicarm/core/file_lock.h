// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <utility>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Between reading a file and replacing it, keeps other programs and threads that do the same from losing
/// what this one writes: by a lock file beside it, NAME.lock, which is removed afterwards.
class FileLock {
 public:
  /// Waits for others up to 60 s. Refuses cannot_write: the folder or an existing file cannot be written, or
  /// another program holds the lock.
  static Expected<FileLock> of(const std::filesystem::path& file);
  ~FileLock();
  FileLock(FileLock&& other) noexcept
      : target_(std::move(other.target_)), lock_(std::move(other.lock_)), fd_(std::exchange(other.fd_, -1)) {}
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  FileLock& operator=(FileLock&&) = delete;

  /// The file to be read and replaced, with links resolved.
  const std::filesystem::path& file() const { return target_; }

 private:
  FileLock(std::filesystem::path target, std::filesystem::path lock, int fd)
      : target_(std::move(target)), lock_(std::move(lock)), fd_(fd) {}

  std::filesystem::path target_, lock_;
  int fd_;
};

}  // namespace helicarm
