// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm::receiver {

/// A stored image.
struct Arrival {
  std::filesystem::path path;
  std::string digest;     ///< of the file's bytes
  bool repeated = false;  ///< the same image was already stored
  std::vector<Warning> warnings;
};

/// A folder of received DICOM X-ray images, stored unchanged and readable by the owner only, because they
/// contain patient data. One program at a time, enforced by a lock file. Thread-safe.
class Inbox {
 public:
  /// Creates the folder if needed and removes incomplete files of an earlier run. Refuses cannot_write, also
  /// if another program uses the folder.
  static Expected<std::unique_ptr<Inbox>> open(const std::filesystem::path& folder);
  ~Inbox();
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  /// Checks a whole DICOM file like `read_dicom` and stores it atomically as SOP-INSTANCE-UID.dcm. The same
  /// image in another transfer syntax is a repetition; another image under a known UID keeps both files, the
  /// new one as UID~2.dcm, with the warning uid_reused. If the folder or its lock was deleted or replaced
  /// during operation, this and all later calls fail with cannot_write; it is not recreated. `origin` begins
  /// each message; no message contains patient data.
  Expected<Arrival> store(std::string_view file, const std::string& origin);

  /// SOP class of a stored image. Refuses missing_file, and cannot_write like `store`.
  Expected<std::string> class_of(const std::string& sop_instance) const;

  const std::filesystem::path& folder() const { return folder_; }

 private:
  Inbox(std::filesystem::path folder, int lock) : folder_(std::move(folder)), lock_(lock) {}
  void check_folder(const std::string& origin) const;

  std::filesystem::path folder_;
  int lock_;
  mutable std::mutex naming_;
};

/// A DICOM file (PS3.10) with the data set as received; the UIDs must be valid.
std::string dicom_file(std::string_view sop_class, std::string_view sop_instance,
                       std::string_view transfer_syntax, std::string_view data_set);

}  // namespace helicarm::receiver
