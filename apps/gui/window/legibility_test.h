// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QAbstractSpinBox>
#include <QAccessible>
#include <QApplication>
#include <QButtonGroup>
#include <QComboBox>
#include <QHeaderView>
#include <QLineEdit>
#include <QScrollArea>
#include <QScrollBar>
#include <QSlider>
#include <QStatusBar>
#include <QTest>
#include <cmath>
#include <map>
#include <set>

#include "gui/window/main_window.h"
#include "gui/window/page_table.h"
#include "gui/window/step_strip.h"

/// What a person could not read, reach or hear of a window, a sentence each.
namespace helicarm::gui {

inline QString described(const QWidget& widget) {
  QString words = widget.objectName();
  if (const auto* label = qobject_cast<const QLabel*>(&widget)) words += " \"" + label->text().left(40) + '"';
  if (const auto* button = qobject_cast<const QAbstractButton*>(&widget))
    words += " \"" + button->text() + '"';
  return QString("%1 %2").arg(widget.metaObject()->className(), words);
}

/// By Tab, or by the arrow keys among buttons of which one is chosen.
inline bool is_reached_by_key(const QWidget& widget) {
  const auto* button = qobject_cast<const QAbstractButton*>(&widget);
  const bool is_one_of_some =
      button && ((button->group() && button->group()->exclusive()) || button->autoExclusive());
  return (widget.focusPolicy() & Qt::TabFocus) || is_one_of_some;
}

inline bool is_interactive(const QWidget& widget) {
  const QString name = widget.objectName();
  if (name.startsWith("qt_") || widget.inherits("QTableCornerButton") || widget.inherits("QComboBoxListView"))
    return false;
  for (const char* kind : {"QAbstractButton", "QComboBox", "QAbstractSpinBox", "QLineEdit", "QSlider",
                           "QAbstractItemView", "helicarm::gui::XrayView", "helicarm::gui::SceneView"})
    if (widget.inherits(kind)) return !widget.inherits("QHeaderView");
  return false;
}

/// Of a colour by WCAG 2.
inline double luminance(const QColor& colour) {
  const auto linear = [](double value) {
    return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  };
  return 0.2126 * linear(colour.redF()) + 0.7152 * linear(colour.greenF()) + 0.0722 * linear(colour.blueF());
}

inline double contrast(const QColor& a, const QColor& b) {
  const double one = luminance(a) + 0.05, other = luminance(b) + 0.05;
  return std::max(one, other) / std::min(one, other);
}

/// Largest contrast of a pixel with the most frequent colour.
inline double contrast_in(const QImage& image) {
  std::map<QRgb, int> counts;
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) ++counts[image.pixel(x, y)];
  if (counts.empty()) return 1;
  const QRgb ground =
      std::ranges::max_element(counts, {}, [](const auto& each) { return each.second; })->first;
  double largest = 1;
  for (const auto& [colour, count] : counts)
    largest = std::max(largest, contrast(QColor(colour), QColor(ground)));
  return largest;
}

inline void check_place(const QWidget& widget, const QWidget& window, QStringList& wrong) {
  const QWidget* page = nullptr;  // what scrolls up and down
  for (const QWidget* up = widget.parentWidget(); up != nullptr; up = up->parentWidget())
    if (qobject_cast<const QScrollArea*>(up) != nullptr)
      page = static_cast<const QScrollArea*>(up)->viewport();
  const QWidget& bounds = page != nullptr ? *page : window;
  const QRect at(widget.mapTo(&bounds, QPoint()), widget.size());
  const bool is_cut = at.left() < 0 || at.right() >= bounds.width() ||
                      (page == nullptr && (at.top() < 0 || at.bottom() >= bounds.height()));
  if (is_cut) wrong << described(widget) + " is cut";
}

inline void check_room(const QWidget& widget, QStringList& wrong) {
  if (const auto* label = qobject_cast<const QLabel*>(&widget)) {
    if (label->objectName() == "told" || label->text().isEmpty()) return;  // its tooltip and a page say it
    const bool fits = label->wordWrap() ? label->height() >= label->heightForWidth(label->width())
                                        : label->width() >= label->minimumSizeHint().width();
    if (!fits) wrong << described(widget) + " has no room for its text";
  } else if (widget.objectName().startsWith("qt_")) {
    return;  // Qt's own, without text
  } else if (qobject_cast<const QAbstractButton*>(&widget) || qobject_cast<const QComboBox*>(&widget) ||
             qobject_cast<const QAbstractSpinBox*>(&widget)) {
    if (widget.width() < widget.minimumSizeHint().width() ||
        widget.height() < widget.minimumSizeHint().height())
      wrong << described(widget) + " is smaller than its text";
  }
}

inline void check_table(const PageTable& table, QStringList& wrong) {
  int used = 0;
  for (int column = 0; column < table.columnCount(); ++column) {
    if (table.isColumnHidden(column)) continue;
    used += table.columnWidth(column);
    const QFontMetrics metrics = table.fontMetrics();
    if (metrics.horizontalAdvance(table.horizontalHeaderItem(column)->text()) > table.columnWidth(column))
      wrong << table.objectName() + ": elided " + table.horizontalHeaderItem(column)->text();
    for (int row = 0; row < table.rowCount(); ++row) {
      const QRect cell(0, 0, table.columnWidth(column) - 4, table.rowHeight(row));
      const QRect words = metrics.boundingRect(cell, Qt::TextWordWrap, table.item(row, column)->text());
      if (words.height() > cell.height() || words.width() > cell.width())
        wrong << table.objectName() + ": elided " + table.item(row, column)->text();
    }
  }
  if (used > table.viewport()->width()) wrong << table.objectName() + " is wider than its page";
  if (table.verticalScrollBar()->maximum() > 0) wrong << table.objectName() + " hides rows";
}

inline void check_card(const StepButton& card, const QWidget& page, QStringList& wrong) {
  const auto [figure, why] = card.words();
  if (figure.join("").contains("…")) wrong << card.card().name + ": figure elided: " + figure.join(" ");
  if (!why.join("").contains("…")) return;
  const bool is_waiting = card.card().status == StepStatus::waiting;
  QString message = card.card().why.section(" (", 0, -2);  // without its view and code
  if (message.contains(": ")) message = message.section(": ", 1);
  for (const QLabel* label : page.findChildren<QLabel*>())
    if (label->isVisibleTo(&page) && (is_waiting || label->text().contains(message))) return;
  wrong << card.card().name + ": elided, and not on its page: " + card.card().why;
}

/// Of the parts of a window or dialog that are displayed at present.
inline QStringList illegible_parts(QWidget& window) {
  QStringList wrong;
  for (QWidget* widget : window.findChildren<QWidget*>()) {
    if (!widget->isVisible() || widget->window() != &window) continue;
    check_room(*widget, wrong);
    if (is_interactive(*widget) || qobject_cast<QLabel*>(widget)) check_place(*widget, window, wrong);
    if (const auto* table = qobject_cast<PageTable*>(widget)) check_table(*table, wrong);
    if (!is_interactive(*widget)) continue;
    QAccessibleInterface* spoken = QAccessible::queryAccessibleInterface(widget);
    if (spoken == nullptr || spoken->text(QAccessible::Name).trimmed().isEmpty())
      wrong << described(*widget) + " has no name";
    if (!is_reached_by_key(*widget) && widget->objectName() != "stop")
      wrong << described(*widget) + " is not reached by Tab";
  }
  return wrong;
}

/// Of what is displayed at present.
inline QStringList illegible(MainWindow& window) {
  QStringList wrong = illegible_parts(window);
  if (window.statusBar()->geometry().bottom() >= window.height() ||
      window.statusBar()->height() < window.statusBar()->fontMetrics().height())
    wrong << "the status line is cut";
  auto* pages = window.findChild<QStackedWidget*>("pages");
  int bars = 0;
  for (const QScrollBar* bar : pages->currentWidget()->findChildren<QScrollBar*>()) bars += bar->isVisible();
  if (bars > 1) wrong << QString("%1 scroll bars").arg(bars);
  for (const Phase phase : phases)
    if (const StepButton& card = *window.strip().button(phase); card.isVisible())
      check_card(card, *static_cast<QScrollArea*>(pages->widget(int(phase)))->widget(), wrong);
  return wrong;
}

/// Text of too little contrast on the displayed page, its tables selected and not, and on the cards.
inline QStringList faint(MainWindow& window) {
  constexpr double least = 4.5;
  QStringList wrong;
  const auto check = [&](const QImage& image, const QString& what) {
    if (const double found = contrast_in(image); found < least)
      wrong << QString("%1: contrast %2").arg(what).arg(found, 0, 'f', 2);
  };
  for (QWidget* widget : window.findChildren<QWidget*>()) {
    if (!widget->isVisible() || !widget->isEnabled() || widget->window() != &window) continue;
    const auto* label = qobject_cast<QLabel*>(widget);
    if ((label && !label->text().isEmpty()) || qobject_cast<QAbstractButton*>(widget) ||
        qobject_cast<QComboBox*>(widget))
      check(widget->grab(widget->rect().adjusted(3, 3, -3, -3)).toImage(), described(*widget));
    auto* table = qobject_cast<PageTable*>(widget);
    for (int row = 0; table != nullptr && row < table->rowCount(); ++row)
      for (const bool is_selected : {true, false}) {
        const QSignalBlocker quiet(table);
        if (is_selected)
          table->selectRow(row);
        else
          table->clearSelection();
        for (int column = 0; column < table->columnCount(); ++column)
          if (!table->isColumnHidden(column) && table->item(row, column)->text().size() > 1)
            check(table->viewport()
                      ->grab(table->visualItemRect(table->item(row, column)).adjusted(3, 2, -3, -2))
                      .toImage(),
                  QString("%1 \"%2\"%3")
                      .arg(table->objectName(), table->item(row, column)->text(),
                           is_selected ? " selected" : ""));
      }
  }
  return wrong;
}

/// What Tab reaches from the present focus until it comes back.
inline std::set<QWidget*> reached_by_tab() {
  std::set<QWidget*> reached;
  for (int left = 300; left > 0; --left) {
    QWidget* focus = QApplication::focusWidget();
    if (focus == nullptr || !reached.insert(focus).second) break;
    QTest::keyClick(focus, Qt::Key_Tab);
  }
  return reached;
}

}  // namespace helicarm::gui
