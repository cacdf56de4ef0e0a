// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "command.h"

namespace helicarm::cli {

struct OperateArguments {
  int cases = 4;  ///< pairs of bones
  int size = 1024;
  double rate_hz = 60;
  std::filesystem::path out = "operate";
};

/// Table 2's experiment with virtual devices, end to end over sockets.
CommandResult operate_command(const OperateArguments& arguments, Console& console);

}  // namespace helicarm::cli
