// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QFileDialog>
#include <filesystem>
#include <functional>
#include <vector>

namespace helicarm::gui {

/// Shows a dialog that keeps the window, and STOP in it, accessible.
inline void show_beside(QDialog* dialog) {
  dialog->setAttribute(Qt::WA_DeleteOnClose);
  dialog->setModal(false);
  dialog->show();
}

/// Lets the user choose files or folders; `then` takes at least one.
inline void ask_files(QWidget* parent, const QString& title, QFileDialog::FileMode mode,
                      const QString& filter,
                      std::function<void(const std::vector<std::filesystem::path>&)> then) {
  auto* dialog = new QFileDialog(parent, title, {}, filter);
  dialog->setFileMode(mode);
  QObject::connect(dialog, &QFileDialog::filesSelected, parent,
                   [then = std::move(then)](const QStringList& chosen) {
                     std::vector<std::filesystem::path> paths;
                     for (const QString& name : chosen) paths.emplace_back(name.toStdString());
                     if (!paths.empty()) then(paths);
                   });
  show_beside(dialog);
}

}  // namespace helicarm::gui
