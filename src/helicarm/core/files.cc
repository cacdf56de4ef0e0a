// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"

#include <atomic>
#include <cerrno>
#include <fstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/private_files.h"
#include "helicarm/core/system_message.h"

namespace helicarm {
namespace fs = std::filesystem;

namespace {

bool sync_to_disk(const fs::path& path, int flags) {
  const int fd = ::open(path.c_str(), flags);
  if (fd < 0) return false;
  const bool good = ::fsync(fd) == 0;
  ::close(fd);
  return good;
}

using Write = std::function<Expected<void>(const fs::path& aside)>;

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

fs::path name_aside(const fs::path& path) {
  static std::atomic<unsigned> serial{0};
  return folder_of(path) / fmt::format(".{}.{}.{}.part", path.filename().string(), ::getpid(), serial++);
}

Expected<void> write_bytes(const fs::path& aside, const fs::path& path, std::string_view bytes) {
  std::ofstream out(aside, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) return fail(Reason::cannot_write, fmt::format("{}: {}", path.string(), system_message(errno)));
  return {};
}

/// Atomic replacement: temporary file, fsync, rename, fsync of the folder.
Expected<void> replace_file(const fs::path& path, const Write& write) {
  std::error_code ec;
  const fs::path aside = name_aside(path);
  auto written = write(aside);
  const auto refuse = [&](Failure failure) {
    fs::remove(aside, ec);
    return tl::unexpected<Failure>(std::move(failure));
  };
  if (!written) return refuse(written.error());
  if (!sync_to_disk(aside, O_RDONLY) || ::rename(aside.c_str(), path.c_str()) != 0)
    return refuse(
        {Reason::cannot_write, fmt::format("{}: {}", path.string(), system_message(errno)), {}, {}});
  sync_to_disk(folder_of(path), O_RDONLY | O_DIRECTORY);
  return {};
}

}  // namespace

Expected<std::string> read_file(const fs::path& path, std::uintmax_t max_bytes) {
  std::error_code ec;
  const auto status = fs::status(path, ec);
  if (!fs::exists(status)) return fail(Reason::missing_file, fmt::format("{}: no such file", path.string()));
  if (!fs::is_regular_file(status))
    return fail(Reason::missing_file, fmt::format("{}: not a regular file", path.string()));
  const auto size = fs::file_size(path, ec);
  if (ec || size > max_bytes)
    return fail(Reason::bad_size, fmt::format("{}: {} bytes, limit {}", path.string(), size, max_bytes));
  std::ifstream in(path, std::ios::binary);
  std::string bytes(size, '\0');
  if (!in.read(bytes.data(), static_cast<std::streamsize>(size)))
    return fail(Reason::missing_file, fmt::format("{}: cannot be read", path.string()));
  return bytes;
}

Expected<void> write_file(const fs::path& path, std::string_view bytes) {
  return write_file_with(path, [&](const fs::path& aside) { return write_bytes(aside, path, bytes); });
}

Expected<void> write_file_in_folder(const fs::path& path, std::string_view bytes) {
  return replace_file(path, [&](const fs::path& aside) { return write_bytes(aside, path, bytes); });
}

Expected<void> make_private_folder(const fs::path& named) {
  const fs::path folder = named.has_filename() ? named : named.parent_path();
  std::error_code ec;
  if (fs::is_directory(folder, ec)) return {};
  fs::create_directories(folder_of(folder), ec);
  if (::mkdir(folder.c_str(), 0700) == 0 || fs::is_directory(folder, ec)) return {};
  return fail(Reason::cannot_write, fmt::format("{}: is not a folder and cannot be created: {}",
                                                folder.string(), ec ? ec.message() : system_message(errno)));
}

Expected<void> make_private_file(const fs::path& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (fd < 0 || ::fchmod(fd, 0600) != 0) {
    const int error = errno;
    if (fd >= 0) ::close(fd);
    return fail(Reason::cannot_write, fmt::format("{}: {}", path.string(), system_message(error)));
  }
  ::close(fd);
  return {};
}

Expected<void> write_private_file(const fs::path& path, std::string_view bytes) {
  return replace_file(path, [&](const fs::path& aside) {
    return make_private_file(aside).and_then([&] { return write_bytes(aside, path, bytes); });
  });
}

Expected<void> write_file_with(const fs::path& path, const Write& write) {
  std::error_code ec;
  const fs::path folder = folder_of(path);
  fs::create_directories(folder, ec);
  if (!fs::is_directory(folder, ec))
    return fail(Reason::cannot_write, fmt::format("{}: is not a folder and cannot be created{}",
                                                  folder.string(), ec ? ": " + ec.message() : ""));
  return replace_file(path, write);
}

Expected<fs::path> path_inside(const fs::path& folder, const std::string& relative) {
  const auto outside = [&] {
    return fail(Reason::path_outside,
                fmt::format("\"{}\": is outside the folder {}", relative, folder.string()));
  };
  if (relative.empty() || relative.find('\0') != std::string::npos)
    return fail(Reason::bad_value, "a file name is empty or contains a NUL");
  const fs::path name(relative);
  if (name.is_absolute()) return outside();
  std::error_code ec;
  const fs::path root = fs::weakly_canonical(folder, ec);
  const fs::path target = fs::weakly_canonical(root / name, ec);
  const fs::path below = target.lexically_relative(root);
  if (ec || below.empty() || *below.begin() == "..") return outside();
  return folder / name;
}

}  // namespace helicarm
