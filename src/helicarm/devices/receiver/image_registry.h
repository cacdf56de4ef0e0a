// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/devices/receiver/watched_folder.h"

namespace helicarm::receiver {

/// Files for `ListedFiles`.
struct FileList {
  std::vector<std::filesystem::path> files;
};

/// The only place that lists sources of images, each by its options.
using ImageSourceOptions = std::variant<ReceiverOptions, FolderOptions, FileList>;

/// Runs on return. Refuses as `DicomReceiver::open`, and missing_file for a folder that does not exist.
Expected<std::unique_ptr<ImageSource>> open_images(const ImageSourceOptions& options, Inbox& inbox,
                                                   ReceiverHooks hooks = {});

}  // namespace helicarm::receiver
