// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QTableWidget>
#include <string>

#include "gui/xray/text.h"
#include "helicarm/report/table.h"

namespace helicarm::gui {

/// Bad cells are red, numbers to the right.
inline void fill(QTableWidget* table, const report::Table& content) {
  table->setRowCount(int(content.rows.size()));
  for (int row = 0; row < table->rowCount(); ++row)
    for (int column = 0; column < table->columnCount(); ++column) {
      const report::Cell& cell = content.rows[std::size_t(row)][std::size_t(column)];
      auto* item = table->item(row, column);
      if (item == nullptr) table->setItem(row, column, item = new QTableWidgetItem);
      item->setText(text(cell.text));
      item->setForeground(cell.is_bad ? QBrush(QColor("#e05252")) : QBrush());
      const auto side = content.columns[std::size_t(column)].is_number ? Qt::AlignRight : Qt::AlignLeft;
      item->setTextAlignment(side | Qt::AlignVCenter);
    }
}

inline QString number(double value, int decimals) { return QString::number(value, 'f', decimals); }

}  // namespace helicarm::gui
