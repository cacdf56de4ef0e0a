// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <ostream>

#include "helicarm/core/failure.h"

namespace helicarm::cli {

/// Context of every command. Answers go to `out`, progress and messages to `progress`.
struct Console {
  std::ostream& out;
  std::ostream& progress;
  bool json = false;
  bool quiet = false;
  unsigned threads = 0;
  std::uint64_t seed = 1;
  bool answered = false;  ///< the command printed its own answer to a refusal, with --json
  bool tags = false;      ///< progress in the tags of Slicer's Execution Model
};

/// A command is `CommandResult name_command(const NameArguments&, Console&)` in name_command.cc, with its
/// options in `add_name`; main.cc converts its failure to a message and an exit code.
using CommandResult = Expected<void>;

}  // namespace helicarm::cli
