// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "command.h"

namespace helicarm::cli {

struct PickArguments {
  std::filesystem::path folder;              ///< holds case.json
  std::optional<std::filesystem::path> csv;  ///< name,view,u_px,v_px[,sigma_px]
};

/// Opens the desktop application on a case, which replaces this process; with a table, writes its picks into
/// case.json.
CommandResult pick_command(const PickArguments& arguments, Console& console);

}  // namespace helicarm::cli
