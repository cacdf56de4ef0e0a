// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "command.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::cli {

/// `helicarm register CASE --out DIR`.
struct RegisterArguments {
  std::filesystem::path folder;
  std::filesystem::path out = "registration";
  case_registration::RegisterOptions options;
};

CommandResult register_command(const RegisterArguments& arguments, Console& console);

}  // namespace helicarm::cli
