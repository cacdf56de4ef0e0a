// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QSettings>
#include <filesystem>
#include <vector>

namespace helicarm::gui {

enum class Folder { cases, sessions };

inline constexpr int most_recent = 10;

/// Folders that were opened, the newest first; those that are no more are left out. Paths alone are kept:
/// nothing of what lies in them.
std::vector<std::filesystem::path> recent_folders(const QSettings& settings, Folder kind);

/// Puts a folder first; the eleventh is forgotten.
void remember_folder(QSettings& settings, Folder kind, const std::filesystem::path& folder);

void forget_folders(QSettings& settings, Folder kind);

}  // namespace helicarm::gui
