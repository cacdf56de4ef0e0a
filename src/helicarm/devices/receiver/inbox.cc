// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/inbox.h"

#include <cerrno>
#include <fstream>
#include <optional>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
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
constexpr std::streamsize meta_bytes = 4096;
constexpr std::uintmax_t most_file_bytes = std::uintmax_t{1} << 30;

void remove_parts(const fs::path& folder) {
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(folder, ec)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.') && name.ends_with(".part")) fs::remove(entry.path(), ec);
  }
}

/// Checks the structure of every frame and decodes the first. What the file breaks or holds too much, as
/// warnings.
std::vector<Warning> check_image(std::string_view file, const std::string& origin) {
  std::vector<Warning> warnings = value_or_throw(xray::read_dicom(file, origin, 1)).warnings;
  std::erase_if(warnings, [](const Warning& warning) {
    return warning.reason != Reason::irregular_file && warning.reason != Reason::surplus_data;
  });
  return warnings;
}

std::string meta_element(std::uint16_t number, std::string_view vr, std::string value) {
  if (value.size() % 2 != 0) value += '\0';
  const auto word = [](std::size_t v) { return std::string{char(v & 0xFF), char(v >> 8 & 0xFF)}; };
  const std::string length = vr == "OB" ? word(0) + word(value.size()) + word(0) : word(value.size());
  return word(2) + word(number) + std::string(vr) + length + value;
}

/// Media Storage SOP Class UID of a file's first bytes, without reading its image.
std::optional<std::string> class_in_meta_group(std::string_view head) {
  const auto byte = [&](std::size_t at) { return std::size_t{static_cast<unsigned char>(head[at])}; };
  for (std::size_t at = 132; at + 12 <= head.size() && head.substr(at, 2) == std::string_view("\2\0", 2);) {
    const bool wide = head.substr(at + 4, 2) == "OB";
    const std::size_t start = at + (wide ? 12 : 8);
    const std::size_t length =
        wide ? byte(at + 8) | byte(at + 9) << 8 | byte(at + 10) << 16 : byte(at + 6) | byte(at + 7) << 8;
    if (length > head.size() - start) return {};
    if (head.substr(at, 4) == std::string_view("\2\0\2\0", 4)) {
      std::string_view uid = head.substr(start, length);
      while (uid.ends_with('\0') || uid.ends_with(' ')) uid.remove_suffix(1);
      return std::string(uid);
    }
    at = start + length;
  }
  return {};
}

}  // namespace

Expected<std::unique_ptr<Inbox>> Inbox::open(const fs::path& folder) {
  if (auto created = make_private_folder(folder); !created) return tl::unexpected<Failure>(created.error());
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
    std::vector<Warning> warnings = check_image(file, origin);
    const std::string uid(value_or_throw(xray::walk_dicom(file, origin)).text(xray::tags::sop_instance));
    if (!dicom::is_uid(uid))
      throw BadInput(Reason::bad_value, fmt::format("{}: SOP Instance UID is not valid", origin));
    Arrival arrival{{}, xray::digest(file), false, std::move(warnings)};
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
    value_or_throw(write_private_file(arrival.path, file));
    return arrival;
  });
}

Expected<std::string> Inbox::class_of(const std::string& sop_instance) const {
  return guarded([&]() -> std::string {
    const std::string origin = "storage commitment";
    const std::lock_guard naming(naming_);  // a new file's name is synced too when `store` returns it
    check_folder(origin);
    const fs::path path = folder_ / (sop_instance + ".dcm");
    std::ifstream file(path, std::ios::binary);
    std::string head(meta_bytes, '\0');
    if (!dicom::is_uid(sop_instance) || !file)
      throw BadInput(Reason::missing_file, fmt::format("{}: {} is not stored", origin, sop_instance));
    file.read(head.data(), meta_bytes);
    head.resize(static_cast<std::size_t>(file.gcount()));
    return class_in_meta_group(head).value_or("");
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
