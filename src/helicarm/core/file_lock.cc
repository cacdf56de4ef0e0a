// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/file_lock.h"

#include <cerrno>
#include <chrono>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/system_message.h"

namespace helicarm {
namespace fs = std::filesystem;

namespace {

using LockClock = std::chrono::steady_clock;

constexpr std::chrono::seconds lock_patience{60};
constexpr std::chrono::milliseconds lock_pause{5};

/// Whether this descriptor's file still has this name: its last holder may have removed it.
bool is_named(int fd, const fs::path& name) {
  struct stat ours, named;
  return ::fstat(fd, &ours) == 0 && ::stat(name.c_str(), &named) == 0 && ours.st_dev == named.st_dev &&
         ours.st_ino == named.st_ino;
}

}  // namespace

Expected<FileLock> FileLock::of(const fs::path& file) {
  std::error_code ec;
  fs::path target = fs::weakly_canonical(file, ec);
  if (ec) target = file;
  const auto refuse = [&](std::string_view why) {
    return fail(Reason::cannot_write, fmt::format("{}: {}", file.string(), why));
  };
  if (fs::exists(target, ec) && ::access(target.c_str(), W_OK) != 0) return refuse(system_message(errno));
  if (fs::is_directory(target, ec)) return refuse("is a folder");
  fs::path lock = target;
  lock += ".lock";
  for (const auto until = LockClock::now() + lock_patience;; std::this_thread::sleep_for(lock_pause)) {
    const int fd = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0) return refuse(fmt::format("{}: {}", lock.string(), system_message(errno)));
    if (::flock(fd, LOCK_EX | LOCK_NB) == 0 && is_named(fd, lock))
      return FileLock(std::move(target), std::move(lock), fd);
    ::close(fd);
    if (LockClock::now() > until) return refuse(fmt::format("{} is held by another program", lock.string()));
  }
}

FileLock::~FileLock() {
  if (fd_ < 0) return;
  ::unlink(lock_.c_str());
  ::close(fd_);
}

}  // namespace helicarm
