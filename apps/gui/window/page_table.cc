// SPDX-License-Identifier: Apache-2.0
#include "gui/window/page_table.h"

#include <QHeaderView>
#include <QScrollArea>
#include <QScrollBar>
#include <QStyledItemDelegate>
#include <algorithm>

#include "gui/window/style.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

constexpr int beside_text_px = 12, above_text_px = 8;
constexpr int is_bad_role = Qt::UserRole;
/// Of the table's width, from which a column's words wrap.
constexpr double widest_share = 0.5;

/// A cell keeps its colour while its row is selected, in either theme.
class CellDelegate : public QStyledItemDelegate {
 public:
  using QStyledItemDelegate::QStyledItemDelegate;

 protected:
  void initStyleOption(QStyleOptionViewItem* option, const QModelIndex& index) const override {
    QStyledItemDelegate::initStyleOption(option, index);
    const QColor colour = index.data(is_bad_role).toBool() ? style::colours().red : style::colours().text;
    option->palette.setColor(QPalette::HighlightedText, colour);
    option->palette.setColor(QPalette::Text, colour);
  }
};

}  // namespace

PageTable::PageTable(const report::Table& content, const char* name, QWidget* parent)
    : QTableWidget(0, int(content.columns.size()), parent), others_(new QLabel) {
  setObjectName(name);
  setAccessibleName(content.heading.empty() ? text(content.columns.front().title) : text(content.heading));
  for (int i = 0; i < columnCount(); ++i) {
    auto* header = new QTableWidgetItem(text(content.columns[std::size_t(i)].title));
    header->setToolTip(text(content.columns[std::size_t(i)].definition));
    setHorizontalHeaderItem(i, header);
  }
  horizontalHeader()->setStretchLastSection(true);
  horizontalHeader()->setSectionResizeMode(QHeaderView::Fixed);
  verticalHeader()->hide();
  setEditTriggers(QAbstractItemView::NoEditTriggers);
  setSelectionBehavior(QAbstractItemView::SelectRows);
  setTabKeyNavigation(false);
  setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  setVerticalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setItemDelegate(new CellDelegate(this));
  others_->setObjectName(QString(name) + "Others");
  others_->setWordWrap(true);
  others_->setProperty("class", "quiet");
  connect(this, &QTableWidget::itemSelectionChanged, this, &PageTable::show_others);
  connect(this, &QTableWidget::currentItemChanged, this, [this](const QTableWidgetItem* now) {
    QWidget* page = parentWidget();
    auto* scrolls = page && page->parentWidget()
                        ? qobject_cast<QScrollArea*>(page->parentWidget()->parentWidget())
                        : nullptr;
    if (now == nullptr || scrolls == nullptr) return;
    const QPoint at = viewport()->mapTo(page, visualItemRect(now).center());
    scrolls->ensureVisible(at.x(), at.y(), 0, 2 * rowHeight(now->row()));
  });
}

void PageTable::fill(const report::Table& content) {
  const int selected = selectionModel()->hasSelection() ? currentRow() : -1;
  const auto name_in = [&](int row) {
    return row >= 0 && row < rowCount() && item(row, 0) ? item(row, 0)->text() : QString();
  };
  const QString chosen = name_in(selected);
  put(content);
  if (selected >= 0 && name_in(selected) != chosen) {
    int row = 0;
    while (row < rowCount() && name_in(row) != chosen) ++row;
    if (row < rowCount())
      selectRow(row);
    else
      clearSelection();
  }
}

void PageTable::put(const report::Table& content) {
  setRowCount(int(content.rows.size()));
  for (int row = 0; row < rowCount(); ++row)
    for (int column = 0; column < columnCount(); ++column) {
      const report::Cell& cell = content.rows[std::size_t(row)][std::size_t(column)];
      auto* shown = item(row, column);
      if (shown == nullptr) setItem(row, column, shown = new QTableWidgetItem);
      shown->setText(text(cell.text));
      shown->setData(is_bad_role, cell.is_bad);
      const auto side = content.columns[std::size_t(column)].is_number ? Qt::AlignRight : Qt::AlignLeft;
      shown->setTextAlignment(side | Qt::AlignVCenter);
    }
  arrange();
}

bool PageTable::is_empty(int column) const {
  for (int row = 0; row < rowCount(); ++row)
    if (const QString words = item(row, column)->text(); !words.isEmpty() && words != "–") return false;
  return rowCount() > 0;
}

int PageTable::width_of(int column) const {
  int widest = fontMetrics().horizontalAdvance(horizontalHeaderItem(column)->text());
  for (int row = 0; row < rowCount(); ++row)
    widest = std::max(widest, fontMetrics().horizontalAdvance(item(row, column)->text()));
  return widest + beside_text_px;
}

int PageTable::height_of(int row) const {
  int highest = fontMetrics().height();
  for (int column = 0; column < columnCount(); ++column) {
    if (isColumnHidden(column)) continue;
    const QRect room(0, 0, columnWidth(column) - beside_text_px, QWIDGETSIZE_MAX);
    highest = std::max(
        highest, fontMetrics().boundingRect(room, Qt::TextWordWrap, item(row, column)->text()).height());
  }
  return highest + above_text_px;
}

void PageTable::arrange() {
  if (arranging_) return;
  arranging_ = true;
  const int room = viewport()->width();
  int left = room;
  bool fits = true, wraps = false;
  for (int place = 0; place < columnCount(); ++place) {
    const int column = horizontalHeader()->logicalIndex(place);
    const int natural = width_of(column);
    const int width = std::min(natural, std::max(int(widest_share * room), style::scaled(120)));
    const bool is_shown = place == 0 || (!is_empty(column) && fits && width <= left);
    if (!is_shown && !is_empty(column)) fits = false;
    setColumnHidden(column, !is_shown);
    if (!is_shown) continue;
    setColumnWidth(column, width);
    left -= width;
    wraps = wraps || width < natural;
  }
  const int line = fontMetrics().height() + above_text_px;
  verticalHeader()->setMinimumSectionSize(line);
  verticalHeader()->setDefaultSectionSize(line);
  int height = horizontalHeader()->sizeHint().height() + 2 * frameWidth() + above_text_px;
  for (int row = 0; row < rowCount(); ++row) {
    setRowHeight(row, wraps ? height_of(row) : line);
    height += rowHeight(row);
  }
  setFixedHeight(height + (rowCount() == 0 ? line : 0));
  verticalScrollBar()->setValue(0);
  show_others();
  arranging_ = false;
}

void PageTable::show_others() {
  QStringList names, values;
  const int row = selectionModel()->hasSelection() ? currentRow() : -1;
  for (int place = 1; place < columnCount(); ++place) {
    const int column = horizontalHeader()->logicalIndex(place);
    if (!isColumnHidden(column) || is_empty(column)) continue;
    names << horizontalHeaderItem(column)->text();
    if (row >= 0 && row < rowCount())
      values << QString("%1: %2").arg(names.back(), item(row, column)->text());
  }
  others_->setVisible(!names.isEmpty() && rowCount() > 0);
  others_->setText(values.isEmpty() ? tr("Select a row for %1.").arg(names.join("; "))
                                    : item(row, 0)->text() + ": " + values.join("; "));
}

void PageTable::resizeEvent(QResizeEvent* event) {
  QTableWidget::resizeEvent(event);
  if (event->size().width() != event->oldSize().width()) arrange();
}

void PageTable::showEvent(QShowEvent* event) {
  QTableWidget::showEvent(event);
  arrange();
}

void PageTable::changeEvent(QEvent* event) {
  QTableWidget::changeEvent(event);
  if (event->type() == QEvent::StyleChange || event->type() == QEvent::FontChange) arrange();
}

}  // namespace helicarm::gui
