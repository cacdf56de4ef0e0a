// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "helicarm/core/failure.h"

/// Files with patient data are readable by their owner only, from their first byte on.
namespace helicarm {

/// Creates the folder, if it does not exist, for its owner only (0700); one that exists keeps its mode.
/// Refuses cannot_write.
Expected<void> make_private_folder(const std::filesystem::path& folder);

/// Like `write_file_in_folder`, with mode 0600.
Expected<void> write_private_file(const std::filesystem::path& path, std::string_view bytes);

/// Creates an empty file with mode 0600, for a library that writes it, or cuts it and sets the mode.
Expected<void> make_private_file(const std::filesystem::path& path);

}  // namespace helicarm
