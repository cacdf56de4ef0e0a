// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/watched_folder.h"

namespace helicarm::receiver {
namespace fs = std::filesystem;

std::vector<fs::path> FolderScan::unchanged_files() {
  std::vector<fs::path> resting;
  std::map<fs::path, Trace> now;
  std::error_code ec;
  for (fs::directory_iterator entry(folder_, ec), end; !ec && entry != end; entry.increment(ec)) {
    std::error_code gone;
    if (entry->path().filename().string().starts_with('.') || entry->is_symlink(gone) ||
        !entry->is_regular_file(gone))
      continue;
    Trace trace{entry->file_size(gone), entry->last_write_time(gone)};
    if (gone) continue;
    const auto before = traces_.find(entry->path());
    if (before != traces_.end() && before->second.size == trace.size &&
        before->second.written == trace.written) {
      if (!before->second.taken) resting.push_back(entry->path());
      trace.taken = true;
    }
    now[entry->path()] = trace;
  }
  if (!ec) traces_ = std::move(now);
  return resting;
}

WatchedFolder::WatchedFolder(FolderOptions options, Inbox& inbox, ReceiverHooks hooks)
    : scan_(std::move(options.folder)),
      inbox_(inbox),
      hooks_(std::move(hooks)),
      pause_(options.pause),
      left_(options.most),
      thread_([this](const std::stop_token& stop) { watch(stop); }) {}

void WatchedFolder::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    for (const fs::path& path : scan_.unchanged_files())
      if (take_file(path, inbox_, hooks_) && left_ && --*left_ == 0) return;
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, pause_, [] { return false; });
  }
}

}  // namespace helicarm::receiver
