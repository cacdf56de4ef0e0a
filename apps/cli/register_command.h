// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "run_command.h"

namespace helicarm::cli {

/// `helicarm register CASE --out DIR [--frames A-B[:STEP]]`.
struct RegisterArguments {
  RunArguments run = {.folder = {}, .out = "registration"};  ///< the C-arm's history is only read
  std::string frames;                                        ///< A-B[:STEP]; empty: one image per view
};

CommandResult register_command(const RegisterArguments& arguments, Console& console);

}  // namespace helicarm::cli
