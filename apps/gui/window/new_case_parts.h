// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QComboBox>
#include <filesystem>

#include "gui/window/page_parts.h"

namespace helicarm::gui {

/// Of the table of images.
enum ImageColumn { file_column, frame_column, view_column, plate_column, found_column, image_columns };

inline QString name_of(const std::filesystem::path& file) { return text(file.filename().string()); }

/// Selects the entry of this value; a file that is not listed is added.
inline void choose(QComboBox* list, const QVariant& value) {
  int at = list->findData(value);
  if (!value.isValid()) at = 0;
  if (at < 0) {
    list->addItem(name_of(value.toString().toStdString()), value);
    at = list->count() - 1;
    list->setItemData(at, value, Qt::ToolTipRole);
  }
  list->setCurrentIndex(at);
}

}  // namespace helicarm::gui
