// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "helicarm/devices/receiver/receiver.h"

namespace helicarm {

/// The files of a folder that have come to rest between two looks. Looks instead of waiting to be told, so
/// that folders shared over a network do as well.
class FolderLook {
 public:
  explicit FolderLook(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Regular files, no links and none whose name begins with a point, each once for every time it was
  /// written. Nothing while the folder is away.
  std::vector<std::filesystem::path> at_rest();

 private:
  struct Trace {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool taken = false;
  };
  std::filesystem::path folder_;
  std::map<std::filesystem::path, Trace> traces_;
};

/// Takes every image that comes into a folder to the inbox, until it is destroyed or has taken `most`. The
/// folder is left as it is. Hooks are called from a thread of its own.
class WatchedFolder {
 public:
  static constexpr std::chrono::milliseconds usual_pause{500};

  WatchedFolder(std::filesystem::path folder, Inbox& inbox, ReceiverHooks hooks,
                std::chrono::milliseconds pause = usual_pause, std::optional<std::uint64_t> most = {});

 private:
  void watch(const std::stop_token& stop);

  FolderLook look_;
  Inbox& inbox_;
  ReceiverHooks hooks_;
  std::chrono::milliseconds pause_;
  std::optional<std::uint64_t> left_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace helicarm
