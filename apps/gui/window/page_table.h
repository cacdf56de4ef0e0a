// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLabel>
#include <QTableWidget>
#include <QWheelEvent>

#include "helicarm/report/table.h"

namespace helicarm::gui {

/// A table as high as its rows, without scroll bars: the page scrolls. It shows as many of its columns as
/// fit, in their order; long words wrap. Bad cells are red, numbers to the right.
class PageTable : public QTableWidget {
  Q_OBJECT

 public:
  PageTable(const report::Table& content, const char* name, QWidget* parent = nullptr);
  /// The selection stays on what it was made on, which the first cell names, and ends with it.
  void fill(const report::Table& content);
  /// Below the table: the selected row's values of the columns that do not fit.
  QLabel* others() { return others_; }

 protected:
  void resizeEvent(QResizeEvent* event) override;
  void showEvent(QShowEvent* event) override;
  void changeEvent(QEvent* event) override;
  /// The page scrolls.
  void wheelEvent(QWheelEvent* event) override { event->ignore(); }

 private:
  void put(const report::Table& content);
  /// Columns, then rows.
  void arrange();
  void show_others();
  bool is_empty(int column) const;
  int width_of(int column) const;
  int height_of(int row) const;

  QLabel* others_;
  bool arranging_ = false;
};

}  // namespace helicarm::gui
