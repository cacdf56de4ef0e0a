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

#include "helicarm/devices/receiver/image_source.h"

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

struct FolderOptions {
  std::filesystem::path folder;
  std::chrono::milliseconds pause{500};    ///< between two polls
  std::optional<std::uint64_t> most = {};  ///< images; empty: without limit
};

/// Takes every image that appears in a folder to the inbox, until it is destroyed or has taken `most`. The
/// folder is not modified. Hooks are called on its own thread.
class WatchedFolder : public ImageSource {
 public:
  WatchedFolder(FolderOptions options, Inbox& inbox, ReceiverHooks hooks);

  std::uint16_t port() const override { return 0; }
  std::uint64_t broken() const override { return 0; }

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
