// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/pdf_layout.h"

#include <QFontMetricsF>
#include <QSvgRenderer>
#include <algorithm>
#include <numeric>

namespace helicarm::gui {
namespace {

const QColor ink("#1d2326"), soft("#5d686e"), rule("#dcd8cf"), bad("#b3261e"), good("#1b7a43"),
    card_paper("#f6f4ef");
constexpr double gap_mm = 4, footer_mm = 9, cell_mm = 1.1, column_mm = 3.5;

QFont font_of(double points, QFont::Weight weight = QFont::Normal) {
  QFont font(QStringList{"Source Sans 3", "Noto Sans", "Open Sans", "DejaVu Sans"});
  font.setStyleHint(QFont::SansSerif);
  font.setPointSizeF(points);
  font.setWeight(weight);
  return font;
}

QColor colour_of(PdfLayout::Tone tone) {
  switch (tone) {
    case PdfLayout::Tone::soft:
      return soft;
    case PdfLayout::Tone::bad:
      return bad;
    case PdfLayout::Tone::good:
      return good;
    default:
      return ink;
  }
}

}  // namespace

PdfLayout::PdfLayout(QPdfWriter& writer, QString footer)
    : writer_(writer),
      footer_(std::move(footer)),
      painter_(&writer),
      dots_per_mm_(writer.resolution() / 25.4),
      width_(writer.width()),
      height_(writer.height() - mm(footer_mm)) {
  painter_.setRenderHints(QPainter::Antialiasing | QPainter::SmoothPixmapTransform |
                          QPainter::LosslessImageRendering);
  begin_page();
}

void PdfLayout::begin_page() {
  y_ = 0;
  painter_.setFont(font_of(7.5));
  painter_.setPen(soft);
  const QRectF line(0, height_ + mm(footer_mm - 5), width_, mm(5));
  painter_.drawText(line, Qt::AlignLeft | Qt::AlignBottom, footer_);
  painter_.drawText(line, Qt::AlignRight | Qt::AlignBottom, QString::number(page_));
}

void PdfLayout::next_page() {
  writer_.newPage();
  ++page_;
  begin_page();
}

void PdfLayout::need(double height) {
  if (y_ > 0 && y_ + height > height_) next_page();
}

double PdfLayout::write(const QString& text, const QFont& font, const QColor& colour) {
  painter_.setFont(font);
  painter_.setPen(colour);
  const QRectF space(0, 0, width_, height_);
  const double height = painter_.boundingRect(space, Qt::TextWordWrap, text).height();
  need(height);
  painter_.drawText(QRectF(0, y_, width_, height), Qt::TextWordWrap, text);
  y_ += height;
  return height;
}

void PdfLayout::title(const QString& text) {
  write(text, font_of(22, QFont::DemiBold), ink);
  y_ += mm(1);
}

void PdfLayout::heading(const QString& text) {
  need(mm(35));  // a heading is not the last line of a page
  if (y_ > 0) y_ += mm(gap_mm);
  write(text, font_of(13, QFont::DemiBold), ink);
  y_ += mm(1.5);
}

void PdfLayout::paragraph(const QString& text, Tone tone) {
  write(text, font_of(tone == Tone::soft ? 8.5 : 9.5), colour_of(tone));
  y_ += mm(1.5);
}

void PdfLayout::cards(const std::vector<LayoutCard>& cards) {
  if (cards.empty()) return;
  constexpr double height = 17, between = 3;
  need(mm(height));
  const double width = (width_ - double(cards.size() - 1) * mm(between)) / double(cards.size());
  for (std::size_t i = 0; i < cards.size(); ++i) {
    const QRectF box(double(i) * (width + mm(between)), y_, width, mm(height));
    painter_.setPen(QPen(rule, mm(0.2)));
    painter_.setBrush(card_paper);
    painter_.drawRoundedRect(box, mm(1.5), mm(1.5));
    const QRectF inside = box.adjusted(mm(2.5), mm(2), -mm(2), -mm(1.5));
    const QFont large = font_of(15, QFont::DemiBold);
    painter_.setFont(large);
    painter_.setPen(ink);
    painter_.drawText(inside, Qt::AlignLeft | Qt::AlignTop, cards[i].value);
    const QFontMetricsF metrics(large, &writer_);
    const double after = metrics.horizontalAdvance(cards[i].value + " ");
    painter_.setFont(font_of(8.5));
    painter_.setPen(soft);
    painter_.drawText(QPointF(inside.left() + after, inside.top() + metrics.ascent()), cards[i].unit);
    painter_.setFont(font_of(7.5));
    painter_.drawText(inside.adjusted(0, metrics.height(), 0, 0), Qt::TextWordWrap | Qt::AlignTop,
                      cards[i].what);
  }
  painter_.setBrush(Qt::NoBrush);
  y_ += mm(height + gap_mm);
}

struct PdfLayout::Row {
  QStringList words;
  std::vector<QColor> inks;
  QFont font;
  const std::vector<double>& widths;
  QColor line;
};

double PdfLayout::row_height(const Row& row) const {
  const QFontMetricsF metrics(row.font, &writer_);
  double height = metrics.height();
  for (qsizetype i = 0; i < row.words.size(); ++i) {
    const QRectF space(0, 0, row.widths[std::size_t(i)], height_);
    height = std::max(height, metrics.boundingRect(space, Qt::TextWordWrap, row.words[i]).height());
  }
  return height + 2 * mm(cell_mm);
}

void PdfLayout::draw(const Row& row, const std::vector<report::Column>& columns) {
  const double height = row_height(row);
  painter_.setFont(row.font);
  double x = 0;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto side = columns[i].is_number ? Qt::AlignRight : Qt::AlignLeft;
    painter_.setPen(row.inks[i]);
    painter_.drawText(QRectF(x, y_ + mm(cell_mm), row.widths[i], height), int(Qt::TextWordWrap | side),
                      row.words[qsizetype(i)]);
    x += row.widths[i] + mm(column_mm);
  }
  y_ += height;
  painter_.setPen(QPen(row.line, mm(0.2)));
  painter_.drawLine(QPointF(0, y_), QPointF(std::min(width_, x - mm(column_mm)), y_));
}

void PdfLayout::table(const report::Table& table) {
  std::vector<double> widths(table.columns.size(), 0);
  Row titles{{}, std::vector(widths.size(), soft), font_of(8, QFont::DemiBold), widths, soft};
  for (const report::Column& column : table.columns) titles.words << QString::fromStdString(column.title);
  std::vector<Row> rows;
  for (const auto& cells : table.rows) {
    Row& row = rows.emplace_back(Row{{}, {}, font_of(8.5), widths, rule});
    for (const report::Cell& cell : cells) {
      row.words << QString::fromStdString(cell.text);
      row.inks.push_back(cell.is_bad ? bad : ink);
    }
  }
  const QFontMetricsF metrics(font_of(8.5), &writer_), title_metrics(titles.font, &writer_);
  for (std::size_t i = 0; i < widths.size(); ++i) {
    widths[i] = title_metrics.horizontalAdvance(titles.words[qsizetype(i)]);
    for (const Row& row : rows)
      widths[i] = std::max(widths[i], metrics.horizontalAdvance(row.words[qsizetype(i)]));
    widths[i] += mm(0.5);
  }
  const double space = width_ - double(widths.size() - 1) * mm(column_mm);
  while (std::accumulate(widths.begin(), widths.end(), 0.0) > space)  // the widest column wraps
    *std::ranges::max_element(widths) *= 0.95;
  need(row_height(titles) + (rows.empty() ? 0 : row_height(rows[0])));
  draw(titles, table.columns);
  for (const Row& row : rows) {
    if (y_ + row_height(row) > height_) {
      next_page();
      draw(titles, table.columns);
    }
    draw(row, table.columns);
  }
  y_ += mm(gap_mm);
}

void PdfLayout::figures(const std::vector<LayoutFigure>& figures) {
  constexpr double between = 5;
  const double width = (width_ - mm(between)) / 2;
  for (std::size_t i = 0; i < figures.size(); i += 2) {
    double tallest = 0;
    const std::size_t end = std::min(i + 2, figures.size());
    std::vector<double> heights;
    for (std::size_t j = i; j < end; ++j) {
      const QSizeF size = QSvgRenderer(figures[j].svg).viewBoxF().size();
      heights.push_back(size.width() > 0 ? width * size.height() / size.width() : 0);
      tallest = std::max(tallest, heights.back());
    }
    painter_.setFont(font_of(8.5));
    need(tallest + mm(12));
    double below = 0;
    for (std::size_t j = i; j < end; ++j) {
      const QRectF box(double(j - i) * (width + mm(between)), y_, width, heights[j - i]);
      painter_.save();
      painter_.setClipRect(box);  // lines may extend beyond the image
      QSvgRenderer(figures[j].svg).render(&painter_, box);
      painter_.restore();
      painter_.setPen(soft);
      painter_.setFont(font_of(8.5));
      QRectF used;
      painter_.drawText(QRectF(box.left(), y_ + tallest + mm(1.2), width, mm(20)), Qt::TextWordWrap,
                        figures[j].caption, &used);
      below = std::max(below, used.height());
    }
    y_ += tallest + below + mm(gap_mm);
  }
}

}  // namespace helicarm::gui
