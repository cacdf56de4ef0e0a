// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QSettings>
#include <filesystem>
#include <vector>

namespace helicarm::gui {

enum class Folder { cases, sessions };

inline constexpr int most_recent = 10;

/// Recently opened folders, newest first; missing ones are left out. Only paths are stored, no content.
std::vector<std::filesystem::path> recent_folders(const QSettings& settings, Folder kind);

/// Puts a folder first; at most ten are kept.
void remember_folder(QSettings& settings, Folder kind, const std::filesystem::path& folder);

void forget_folders(QSettings& settings, Folder kind);

}  // namespace helicarm::gui
