// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/listed_files.h"

namespace helicarm::receiver {

ListedFiles::ListedFiles(std::vector<std::filesystem::path> files, Inbox& inbox, ReceiverHooks hooks)
    : thread_([files = std::move(files), &inbox, hooks = std::move(hooks)](const std::stop_token& stop) {
        for (const std::filesystem::path& file : files)
          if (!stop.stop_requested()) take_file(file, inbox, hooks);
      }) {}

}  // namespace helicarm::receiver
