// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QHeaderView>
#include <QTableWidget>

#include "gui/window/style.h"

namespace helicarm::gui {

/// A table to read and to choose rows of. `name`: of the object; `spoken`: for a screen reader.
inline QTableWidget* list_table(const char* name, const QString& spoken) {
  auto* table = new QTableWidget;
  table->setObjectName(name);
  table->setAccessibleName(spoken);
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setTabKeyNavigation(false);
  table->verticalHeader()->hide();
  table->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  return table;
}

/// A cell of it; what is bad is red.
inline QTableWidgetItem* list_cell(const QString& words, bool is_bad = false) {
  auto* cell = new QTableWidgetItem(words);
  if (is_bad) cell->setForeground(style::colours().red);
  return cell;
}

}  // namespace helicarm::gui
