// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/label_placer.h"

#include <QFontMetricsF>
#include <limits>

namespace helicarm::gui {

void outlined_text(QPainter& painter, const QPointF& at, const QString& words, const QColor& colour) {
  // Glyphs from the font cache: ten times as fast as outlined paths.
  painter.setPen(QColor(0, 0, 0, 200));
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) painter.drawText(at + QPointF(x, y), words);
  painter.setPen(colour);
  painter.drawText(at, words);
}

void text_box(QPainter& painter, const QPointF& at, const QString& words, const QRectF& bounds) {
  constexpr double apart = 16, rim = 7;
  const QSizeF text = QFontMetricsF(painter.font()).boundingRect(bounds, Qt::TextExpandTabs, words).size();
  QRectF box(at + QPointF(apart, apart), text + QSizeF(2 * rim, 2 * rim));
  if (box.right() > bounds.right()) box.moveRight(at.x() - apart);
  if (box.bottom() > bounds.bottom()) box.moveBottom(at.y() - apart);
  box.moveLeft(std::max(box.left(), bounds.left()));
  box.moveTop(std::max(box.top(), bounds.top()));
  painter.setPen(QColor(255, 255, 255, 90));
  painter.setBrush(QColor(16, 20, 26, 235));
  painter.drawRoundedRect(box, 5, 5);
  painter.setPen(QColor(240, 243, 247));
  painter.drawText(box.adjusted(rim, rim, rim, rim), words);
}

void wrapped_box(QPainter& painter, const QPointF& at, const QString& words, const QRectF& bounds,
                 const QColor& edge) {
  constexpr double apart = 16, rim = 6, widest = 250;
  const QRectF room(0, 0, std::min(widest, bounds.width() - 2 * rim), bounds.height());
  const QRectF text = QFontMetricsF(painter.font()).boundingRect(room, Qt::TextWordWrap, words);
  QRectF box(at + QPointF(apart, apart), text.size() + QSizeF(2 * rim, 2 * rim));
  if (box.right() > bounds.right()) box.moveRight(at.x() - apart);
  if (box.bottom() > bounds.bottom()) box.moveBottom(at.y() - apart);
  box.moveLeft(std::max(box.left(), bounds.left()));
  box.moveTop(std::max(box.top(), bounds.top()));
  painter.setPen(QPen(edge, 1.5));
  painter.setBrush(QColor(16, 20, 26, 225));
  painter.drawRoundedRect(box, 5, 5);
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QColor(240, 243, 247));
  painter.drawText(box.adjusted(rim, rim, -rim, -rim), Qt::TextWordWrap, words);
}

double LabelPlacer::hidden_by(const QRectF& box) const {
  const auto area = [](const QRectF& r) { return r.isEmpty() ? 0 : r.width() * r.height(); };
  double hidden = 4 * (area(box) - area(box.intersected(bounds_)));
  for (const QRectF& other : taken_) hidden += area(box.intersected(other));
  return hidden;
}

void LabelPlacer::place(QPainter& painter, const QPointF& mark, double radius, const QString& words,
                        const QColor& colour) {
  if (words.isEmpty() || !bounds_.contains(mark)) return;
  const QFontMetricsF metrics(painter.font());
  const QSizeF size(metrics.horizontalAdvance(words) + 2, metrics.ascent() + metrics.descent());
  QRectF best;
  double least = std::numeric_limits<double>::infinity();
  // Right of the mark before left of it, above before below.
  for (const QPointF& side : {QPointF(1, -0.8), QPointF(1, 0.8), QPointF(-1, -0.8), QPointF(-1, 0.8),
                              QPointF(1, 0), QPointF(-1, 0), QPointF(0, -1), QPointF(0, 1)}) {
    const QPointF centre = mark + QPointF(side.x() * (0.8 * radius + 3 + 0.5 * size.width()),
                                          side.y() * (0.8 * radius + 1 + 0.5 * size.height()));
    const QRectF box(centre - QPointF(0.5 * size.width(), 0.5 * size.height()), size);
    const double hidden = hidden_by(box);
    if (hidden < least) {
      least = hidden;
      best = box;
    }
    if (hidden == 0) break;
  }
  taken_.push_back(best);
  outlined_text(painter, best.topLeft() + QPointF(1, metrics.ascent()), words, colour);
}

}  // namespace helicarm::gui
