// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/inbox.h"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/system_message.h"
#include "helicarm/devices/receiver/pdu.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/digest.h"
#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/same_image.h"

namespace helicarm::receiver {
namespace fs = std::filesystem;

namespace {

constexpr const char* lock_name = ".lock";
constexpr int most_versions = 100;
constexpr std::uintmax_t most_file_bytes = std::uintmax_t{1} << 30;

void remove_parts(const fs::path& folder) {
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(folder, ec)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.') && name.ends_with(".part")) fs::remove(entry.path(), ec);
  }
}

/// Checks the structure of every frame and decodes the first.
void check_image(std::string_view file, const std::string& origin) {
  value_or_throw(xray::read_dicom(file, origin, 1));
}

std::string meta_element(std::uint16_t number, std::string_view vr, std::string value) {
  if (value.size() % 2 != 0) value += '\0';
  const auto word = [](std::size_t v) { return std::string{char(v & 0xFF), char(v >> 8 & 0xFF)}; };
  const std::string length = vr == "OB" ? word(0) + word(value.size()) + word(0) : word(value.size());
  return word(2) + word(number) + std::string(vr) + length + value;
}

}  // namespace

Expected<std::unique_ptr<Inbox>> Inbox::open(const fs::path& folder) {
  std::error_code ec;
  const bool made = fs::create_directories(folder, ec);
  if (ec || !fs::is_directory(folder))
    return fail(Reason::cannot_write,
                fmt::format("{}: is not a folder and cannot be created", folder.string()));
  if (made) fs::permissions(folder, fs::perms::owner_all, ec);
  const int lock = ::open((folder / lock_name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock < 0)
    return fail(Reason::cannot_write, fmt::format("{}: {}", folder.string(), system_message(errno)));
  if (::flock(lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock);
    return fail(
        Reason::cannot_write,
        fmt::format("{}: in use by another program; close it or choose another folder", folder.string()));
  }
  remove_parts(folder);
  return std::unique_ptr<Inbox>(new Inbox(folder, lock));
}

Inbox::~Inbox() { ::close(lock_); }

void Inbox::check_folder(const std::string& origin) const {
  struct stat ours, named;
  if (::fstat(lock_, &ours) == 0 && ::stat((folder_ / lock_name).c_str(), &named) == 0 &&
      ours.st_dev == named.st_dev && ours.st_ino == named.st_ino)
    return;
  throw BadInput(Reason::cannot_write,
                 fmt::format("{}: the inbox {} was deleted or replaced during operation: restart the program",
                             origin, folder_.string()));
}

Expected<Arrival> Inbox::store(std::string_view file, const std::string& origin) {
  return guarded([&] {
    check_image(file, origin);
    const std::string uid(value_or_throw(xray::walk_dicom(file, origin)).text(xray::tags::sop_instance));
    if (!dicom::is_uid(uid))
      throw BadInput(Reason::bad_value, fmt::format("{}: SOP Instance UID is not valid", origin));
    Arrival arrival{{}, xray::digest(file), false, {}};
    const std::lock_guard naming(naming_);
    check_folder(origin);
    for (int version = 1; version <= most_versions; ++version) {
      arrival.path = folder_ / (version == 1 ? uid + ".dcm" : fmt::format("{}~{}.dcm", uid, version));
      std::error_code ec;
      if (!fs::exists(arrival.path, ec)) break;
      const auto stored = read_file(arrival.path, most_file_bytes);
      if (stored && (*stored == file || xray::same_image(*stored, file))) {
        arrival.repeated = true;
        return arrival;
      }
      if (version == most_versions)
        throw BadInput(Reason::cannot_write,
                       fmt::format("{}: {} images with this UID are stored already", origin, most_versions));
      if (version == 1)
        arrival.warnings.push_back(
            {Reason::uid_reused,
             fmt::format("{}: another image with the same SOP Instance UID is stored already; both are kept",
                         origin)});
    }
    value_or_throw(write_file_in_folder(arrival.path, file));
    std::error_code ec;
    fs::permissions(arrival.path, fs::perms::owner_read | fs::perms::owner_write, ec);
    return arrival;
  });
}

std::string dicom_file(std::string_view sop_class, std::string_view sop_instance,
                       std::string_view transfer_syntax, std::string_view data_set) {
  const std::string meta = meta_element(0x0001, "OB", std::string("\0\1", 2)) +
                           meta_element(0x0002, "UI", std::string(sop_class)) +
                           meta_element(0x0003, "UI", std::string(sop_instance)) +
                           meta_element(0x0010, "UI", std::string(transfer_syntax)) +
                           meta_element(0x0012, "UI", std::string(dicom::implementation_uid)) +
                           meta_element(0x0013, "SH", std::string(dicom::implementation_name));
  std::string size;
  for (int i = 0; i < 4; ++i) size += static_cast<char>(meta.size() >> (8 * i));
  std::string file = std::string(128, '\0') + "DICM" + meta_element(0x0000, "UL", size) + meta;
  file += data_set;
  return file;
}

}  // namespace helicarm::receiver
