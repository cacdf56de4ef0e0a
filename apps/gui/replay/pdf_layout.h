// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QColor>
#include <QFont>
#include <QPainter>
#include <QPdfWriter>
#include <QStringList>
#include <vector>

#include "helicarm/report/table.h"

namespace helicarm::gui {

/// A figure as SVG text with its caption.
struct LayoutFigure {
  QByteArray svg;
  QString caption;
};

/// A key figure: value, unit and name.
struct LayoutCard {
  QString value, unit, what;
};

/// Fills A4 pages from top to bottom, with page breaks. Lengths in mm.
class PdfLayout {
 public:
  /// `footer` appears on each page.
  PdfLayout(QPdfWriter& writer, QString footer);

  void title(const QString& text);
  void heading(const QString& text);
  enum class Tone { plain, soft, bad, good };
  void paragraph(const QString& text, Tone tone = Tone::plain);
  void cards(const std::vector<LayoutCard>& cards);
  /// Headings repeat on each page.
  void table(const report::Table& table);
  /// Two side by side.
  void figures(const std::vector<LayoutFigure>& figures);

 private:
  double mm(double length) const { return length * dots_per_mm_; }
  void begin_page();
  void next_page();
  /// Starts a new page if less than this height remains.
  void need(double height);
  double write(const QString& text, const QFont& font, const QColor& ink);
  struct Row;
  double row_height(const Row& row) const;
  void draw(const Row& row, const std::vector<report::Column>& columns);

  QPdfWriter& writer_;
  QString footer_;
  QPainter painter_;
  double dots_per_mm_, width_, height_;
  double y_ = 0;
  int page_ = 1;
};

}  // namespace helicarm::gui
