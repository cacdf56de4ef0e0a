// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Whole content of a regular file of at most `max_bytes`.
Expected<std::string> read_file(const std::filesystem::path& path, std::uintmax_t max_bytes);

/// Replaces `path` as a whole or not at all: written aside, fsynced, renamed, folder fsynced.
Expected<void> write_file(const std::filesystem::path& path, std::string_view bytes);

/// As `write_file`, but the folder must be there: it is not made.
Expected<void> write_file_in_folder(const std::filesystem::path& path, std::string_view bytes);

/// As `write_file`, for a library that insists on writing the file itself: `write` fills the name it is
/// given.
Expected<void> write_file_with(
    const std::filesystem::path& path,
    const std::function<Expected<void>(const std::filesystem::path& aside)>& write);

/// `relative` below `folder`; a name that is absolute, or that leaves the folder by ".." or by a link, is
/// refused (path_outside).
Expected<std::filesystem::path> path_inside(const std::filesystem::path& folder, const std::string& relative);

}  // namespace helicarm
