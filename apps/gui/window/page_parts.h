// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QTableWidget>
#include <string>
#include <vector>

namespace helicarm::gui {

inline QString text(const std::string& words) { return QString::fromStdString(words); }

inline void fill(QTableWidget* table, const std::vector<QStringList>& rows) {
  table->setRowCount(int(rows.size()));
  for (int row = 0; row < table->rowCount(); ++row)
    for (int column = 0; column < table->columnCount(); ++column) {
      const QString words = rows[std::size_t(row)].value(column);
      if (auto* item = table->item(row, column); item != nullptr)
        item->setText(words);
      else
        table->setItem(row, column, new QTableWidgetItem(words));
    }
}

inline QString number(double value, int decimals) { return QString::number(value, 'f', decimals); }

}  // namespace helicarm::gui
