// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Whole content of a regular file of at most `max_bytes` bytes.
Expected<std::string> read_file(const std::filesystem::path& path, std::uintmax_t max_bytes);

/// Fails (cannot_write) where no file could be written below `folder`, which need not exist: before work
/// whose result would be lost.
Expected<void> check_can_write(const std::filesystem::path& folder);

/// Replaces `path` atomically: temporary file, fsync, rename, fsync of the folder.
Expected<void> write_file(const std::filesystem::path& path, std::string_view bytes);

/// Like `write_file`, but the folder must exist.
Expected<void> write_file_in_folder(const std::filesystem::path& path, std::string_view bytes);

/// Like `write_file`, for a library that writes the file itself: `write` receives the temporary file's name.
Expected<void> write_file_with(
    const std::filesystem::path& path,
    const std::function<Expected<void>(const std::filesystem::path& aside)>& write);

/// `relative` below `folder`. An absolute name, or one that leaves the folder through ".." or a link, is
/// refused (path_outside).
Expected<std::filesystem::path> path_inside(const std::filesystem::path& folder, const std::string& relative);

}  // namespace helicarm
