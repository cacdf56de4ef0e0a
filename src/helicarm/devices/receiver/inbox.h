// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm {

/// An image that is safely on disk.
struct Arrival {
  std::filesystem::path path;
  std::string digest;     ///< of the file's bytes
  bool repeated = false;  ///< these very bytes were there already
  std::vector<Warning> warnings;
};

/// A folder of received DICOM X-rays, kept as they came and readable by the owner alone: they hold what the
/// C-arm knows of the patient. One program at a time uses it: a lock file says so. Safe to call from several
/// threads.
class Inbox {
 public:
  /// Makes the folder where there is none and clears away what an earlier program left half written. Refuses
  /// cannot_write, also when another program uses it.
  static Expected<std::unique_ptr<Inbox>> open(const std::filesystem::path& folder);
  ~Inbox();
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  /// Checks a whole DICOM file as `read_dicom` does, writes it aside, syncs and renames it to
  /// SOP-INSTANCE-UID.dcm. Other bytes under a known UID keep both files, the new one as UID~2.dcm, with the
  /// warning uid_reused. A folder that was deleted or replaced in operation, or whose lock was, is
  /// cannot_write from then on: it is not made again. `origin` begins each message; no message holds patient
  /// data.
  Expected<Arrival> store(std::string_view file, const std::string& origin);

  const std::filesystem::path& folder() const { return folder_; }

 private:
  Inbox(std::filesystem::path folder, int lock) : folder_(std::move(folder)), lock_(lock) {}
  void check_folder(const std::string& origin) const;

  std::filesystem::path folder_;
  int lock_;
  std::mutex naming_;
};

/// A DICOM file (PS3.10) around a data set as it came; the UIDs are checked ones.
std::string dicom_file(std::string_view sop_class, std::string_view sop_instance,
                       std::string_view transfer_syntax, std::string_view data_set);

}  // namespace helicarm
