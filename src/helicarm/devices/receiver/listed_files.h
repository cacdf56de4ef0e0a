// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <thread>
#include <vector>

#include "helicarm/devices/receiver/image_source.h"

namespace helicarm::receiver {

/// Takes these files to the inbox, once and in their order, on its own thread.
class ListedFiles : public ImageSource {
 public:
  ListedFiles(std::vector<std::filesystem::path> files, Inbox& inbox, ReceiverHooks hooks);

  std::uint16_t port() const override { return 0; }
  std::uint64_t broken() const override { return 0; }

 private:
  std::jthread thread_;
};

}  // namespace helicarm::receiver
