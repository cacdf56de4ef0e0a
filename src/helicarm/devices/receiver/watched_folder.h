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

namespace helicarm::receiver {

/// Files of a folder that did not change between two polls. Polling works on network shares too.
class FolderScan {
 public:
  explicit FolderScan(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Regular files, without links and hidden files, each once per modification. Empty while the folder is
  /// missing.
  std::vector<std::filesystem::path> unchanged_files();

 private:
  struct Trace {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool taken = false;
  };
  std::filesystem::path folder_;
  std::map<std::filesystem::path, Trace> traces_;
};

/// Takes every image that appears in a folder to the inbox, until it is destroyed or has taken `most`. The
/// folder is not modified. Hooks are called on its own thread.
class WatchedFolder {
 public:
  static constexpr std::chrono::milliseconds usual_pause{500};

  WatchedFolder(std::filesystem::path folder, Inbox& inbox, ReceiverHooks hooks,
                std::chrono::milliseconds pause = usual_pause, std::optional<std::uint64_t> most = {});

 private:
  void watch(const std::stop_token& stop);

  FolderScan scan_;
  Inbox& inbox_;
  ReceiverHooks hooks_;
  std::chrono::milliseconds pause_;
  std::optional<std::uint64_t> left_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace helicarm::receiver
