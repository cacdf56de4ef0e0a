// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/recent.h"

#include <QStringList>
#include <algorithm>

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

QString key_of(Folder kind) { return kind == Folder::cases ? "recent/cases" : "recent/sessions"; }

fs::path path_of(const QString& text) { return fs::path(text.toStdString()); }

}  // namespace

std::vector<fs::path> recent_folders(const QSettings& settings, Folder kind) {
  std::vector<fs::path> folders;
  std::error_code ec;
  for (const QString& entry : settings.value(key_of(kind)).toStringList())
    if (folders.size() < most_recent && fs::is_directory(path_of(entry), ec))
      folders.push_back(path_of(entry));
  return folders;
}

void remember_folder(QSettings& settings, Folder kind, const fs::path& folder) {
  std::error_code ec;
  fs::path whole = fs::weakly_canonical(folder, ec);
  if (ec) return;
  if (!whole.has_filename()) whole = whole.parent_path();
  auto folders = recent_folders(settings, kind);
  std::erase(folders, whole);
  folders.insert(folders.begin(), whole);
  QStringList entries;
  for (const fs::path& path : folders)
    if (entries.size() < most_recent) entries << QString::fromStdString(path.string());
  settings.setValue(key_of(kind), entries);
}

void forget_folders(QSettings& settings, Folder kind) { settings.remove(key_of(kind)); }

}  // namespace helicarm::gui
