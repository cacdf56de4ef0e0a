// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm::cli {

struct ReceiveArguments {
  std::filesystem::path out = "inbox";
  receiver::ReceiverOptions receiver;
  std::vector<std::string> report_peers;                ///< TITLE=ADDRESS:PORT
  std::filesystem::path certificate, key, authorities;  ///< all or none
  std::filesystem::path watch;                          ///< empty: listen
  std::optional<std::uint64_t> count;
  std::optional<double> seconds;
};

/// Prints one line (or one line of JSON) for each image until stopped.
CommandResult receive_command(const ReceiveArguments& arguments, Console& console);

}  // namespace helicarm::cli
