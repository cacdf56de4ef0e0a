// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "command.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::cli {

/// `helicarm register CASE --out DIR [--frames A-B[:STEP]]`.
struct RegisterArguments {
  std::filesystem::path folder;
  std::filesystem::path out = "registration";
  case_registration::RegisterOptions options;
  std::string frames;  ///< A-B[:STEP]; empty: one image per view
};

CommandResult register_command(const RegisterArguments& arguments, Console& console);

}  // namespace helicarm::cli
