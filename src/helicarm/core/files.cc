// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/private_files.h"
#include "helicarm/core/system_message.h"

namespace helicarm {
namespace fs = std::filesystem;

namespace {

constexpr mode_t readable_by_all = 0666;  // less the umask

using Write = std::function<Expected<void>(const fs::path& aside)>;

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

fs::path name_aside(const fs::path& path) {
  static std::atomic<unsigned> serial{0};
  return folder_of(path) / fmt::format(".{}.{}.{}.part", path.filename().string(), ::getpid(), serial++);
}

Failure cannot_write(const fs::path& path, int error) {
  return {Reason::cannot_write,
          fmt::format("{}: cannot be written: {}", path.string(), system_message(error))};
}

/// Closed on destruction.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  bool is_open() const { return number_ >= 0; }
  int number() const { return number_; }
  /// The name under which a library may open the file, also one without a name.
  fs::path path() const { return fmt::format("/proc/self/fd/{}", number_); }

 private:
  const int number_;
};

/// What is written before it replaces `path`: a file without a name, which the system removes whatever ends
/// the program, or a named one where the file system has none (NFS, FUSE).
class FileAside {
 public:
  FileAside(const fs::path& path, mode_t mode)
      : path_(path),
        unnamed_(::open(folder_of(path).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, mode)),
        named_(unnamed_.is_open() && fs::exists(unnamed_.path()) ? -1 : open_named(mode)) {}
  ~FileAside() {
    if (!name_.empty()) ::unlink(name_.c_str());
  }
  FileAside(const FileAside&) = delete;
  FileAside& operator=(const FileAside&) = delete;

  bool is_open() const { return file().is_open(); }
  int number() const { return file().number(); }
  fs::path open_as() const { return name_.empty() ? unnamed_.path() : name_; }

  /// True, or errno is set. A name is needed only to replace a file, from link to rename.
  bool replace() {
    if (::fsync(number()) != 0) return false;
    if (name_.empty()) {
      if (linked_to(path_)) return true;
      if (errno != EEXIST) return false;
      name_ = name_aside(path_);
      if (!linked_to(name_)) return false;
    }
    if (::rename(name_.c_str(), path_.c_str()) != 0) return false;
    name_.clear();
    return true;
  }

 private:
  const Descriptor& file() const { return named_.is_open() ? named_ : unnamed_; }
  bool linked_to(const fs::path& name) const {
    return ::linkat(AT_FDCWD, unnamed_.path().c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
  }
  int open_named(mode_t mode) {
    const fs::path name = name_aside(path_);
    const int number = ::open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (number >= 0) name_ = name;
    return number;
  }

  const fs::path& path_;
  fs::path name_;  ///< of the file beside `path_`, where it has one
  Descriptor unnamed_, named_;
};

bool write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

Expected<void> replaced(FileAside& aside, const fs::path& path) {
  if (!aside.replace()) return tl::unexpected<Failure>(cannot_write(path, errno));
  const Descriptor folder(::open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.is_open()) ::fsync(folder.number());
  return {};
}

/// The mode of the file that it replaces: one that its owner made private stays so.
bool takes_mode_of(const fs::path& path, const FileAside& aside) {
  constexpr mode_t permissions = 0777, of_its_writer = 0600;
  struct stat before {
  }, now{};
  if (::stat(path.c_str(), &before) != 0 || !S_ISREG(before.st_mode)) return true;
  if (::fstat(aside.number(), &now) != 0) return false;
  const mode_t mode = (before.st_mode & permissions) | of_its_writer;
  return mode == (now.st_mode & permissions) || ::fchmod(aside.number(), mode) == 0;
}

/// Atomic replacement: unnamed file, fsync, link or rename, fsync of the folder. Without a mode: that of the
/// file that is replaced, else readable by all.
Expected<void> replace_file(const fs::path& path, std::string_view bytes, std::optional<mode_t> mode = {}) {
  FileAside aside(path, mode.value_or(readable_by_all));
  if (!aside.is_open() || (!mode && !takes_mode_of(path, aside)) || !write_all(aside.number(), bytes))
    return tl::unexpected<Failure>(cannot_write(path, errno));
  return replaced(aside, path);
}

Expected<void> make_folder(const fs::path& folder) {
  std::error_code ec;
  fs::create_directories(folder, ec);
  std::error_code ignored;
  if (fs::is_directory(folder, ignored)) return {};
  return fail(Reason::cannot_write, fmt::format("{}: is not a folder and cannot be created{}",
                                                folder.string(), ec ? ": " + ec.message() : ""));
}

bool has_drive(const std::string& name) {
  return name.size() > 2 && std::isalpha(static_cast<unsigned char>(name[0])) && name[1] == ':' &&
         (name[2] == '\\' || name[2] == '/');
}

}  // namespace

namespace {

/// The first JSON files of a folder that stands where a file is wanted: one of them is probably meant.
std::string json_files_in(const fs::path& folder) {
  constexpr std::size_t most = 3;
  std::vector<std::string> names;
  std::error_code ec;
  for (fs::directory_iterator at(folder, ec), end; !ec && at != end; at.increment(ec))
    if (at->path().extension() == ".json") names.push_back(at->path().filename().string());
  std::ranges::sort(names);
  if (names.size() > most) names.resize(most);
  return names.empty() ? "" : fmt::format("; it holds {}", fmt::join(names, ", "));
}

}  // namespace

Expected<std::string> read_file(const fs::path& path, std::uintmax_t max_bytes) {
  std::error_code ec;
  const auto status = fs::status(path, ec);
  if (!fs::exists(status))
    return fail(
        Reason::missing_file,
        fmt::format("{}: {}", path.string(),
                    ec && ec != std::errc::no_such_file_or_directory ? ec.message() : "no such file"));
  if (fs::is_directory(status))
    return fail(Reason::missing_file,
                fmt::format("{}: is a folder, not a file{}", path.string(), json_files_in(path)));
  if (!fs::is_regular_file(status))
    return fail(Reason::missing_file, fmt::format("{}: not a regular file", path.string()));
  const auto size = fs::file_size(path, ec);
  if (ec || size > max_bytes)
    return fail(Reason::bad_size, fmt::format("{}: {} bytes, limit {}", path.string(), size, max_bytes));
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  const int opening_error = in.is_open() ? 0 : errno;
  std::string bytes(size, '\0');
  if (!in.is_open() || !in.read(bytes.data(), static_cast<std::streamsize>(size)))
    return fail(Reason::missing_file,
                fmt::format("{}: cannot be read{}", path.string(),
                            opening_error != 0 ? ": " + system_message(opening_error) : ""));
  return bytes;
}

Expected<void> check_can_write(const fs::path& folder) {
  std::error_code ignored;
  fs::path there = folder.empty() ? fs::path(".") : fs::absolute(folder, ignored);
  while (!fs::exists(there, ignored) && there != there.parent_path()) there = there.parent_path();
  if (!fs::is_directory(there, ignored))
    return fail(Reason::cannot_write, fmt::format("{}: is not a folder", there.string()));
  if (::access(there.c_str(), W_OK | X_OK) != 0) return tl::unexpected<Failure>(cannot_write(there, errno));
  return {};
}

Expected<void> write_file(const fs::path& path, std::string_view bytes) {
  return make_folder(folder_of(path)).and_then([&] { return write_file_in_folder(path, bytes); });
}

Expected<void> write_file_in_folder(const fs::path& path, std::string_view bytes) {
  return replace_file(path, bytes);
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
  return replace_file(path, bytes, 0600);
}

Expected<void> write_file_with(const fs::path& path, const Write& write) {
  if (auto created = make_folder(folder_of(path)); !created) return created;
  FileAside aside(path, readable_by_all);
  if (!aside.is_open() || !takes_mode_of(path, aside))
    return tl::unexpected<Failure>(cannot_write(path, errno));
  return write(aside.open_as()).and_then([&] { return replaced(aside, path); });
}

Expected<fs::path> path_inside(const fs::path& folder, const std::string& relative) {
  const auto outside = [&] {
    return fail(Reason::path_outside,
                fmt::format("\"{}\": is outside the folder {}", relative, folder.string()));
  };
  if (relative.empty() || relative.find('\0') != std::string::npos)
    return fail(Reason::bad_value, "a file name is empty or contains a NUL");
  if (has_drive(relative) || relative.starts_with("\\\\"))
    return fail(
        Reason::path_outside,
        fmt::format("\"{}\": is an absolute path of Windows: write it relative to the folder {}, with / "
                    "between folders",
                    relative, folder.string()));
  const fs::path name(relative);
  if (name.is_absolute()) return outside();
  std::error_code ec;
  if (relative.find('\\') != std::string::npos && !fs::exists(folder / name, ec))
    return fail(Reason::missing_file,
                fmt::format("\"{}\": no such file: write / instead of \\ between folders", relative));
  const fs::path root = fs::weakly_canonical(folder, ec);
  const fs::path target = fs::weakly_canonical(root / name, ec);
  const fs::path below = target.lexically_relative(root);
  if (ec || below.empty() || *below.begin() == "..") return outside();
  return folder / name;
}

}  // namespace helicarm
