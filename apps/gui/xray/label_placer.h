// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <vector>

namespace helicarm::gui {

inline constexpr int label_font_px = 13;

/// Writes text on any ground: dark edge, bright fill, baseline at `at`.
void outlined_text(QPainter& painter, const QPointF& at, const QString& words, const QColor& colour);

/// A few lines in a dark box beside `at`, kept within `bounds`.
void text_box(QPainter& painter, const QPointF& at, const QString& words, const QRectF& bounds);

/// Puts labels beside their marks, where they hide neither marks nor each other as far as there is room.
class LabelPlacer {
 public:
  explicit LabelPlacer(const QRectF& bounds) : bounds_(bounds) {}

  /// A place that no label should hide.
  void keep_free(const QRectF& area) { taken_.push_back(area); }
  /// Writes the label of a mark of this radius; one out of sight is left out.
  void place(QPainter& painter, const QPointF& mark, double radius, const QString& words,
             const QColor& colour);

 private:
  double hidden_by(const QRectF& box) const;

  QRectF bounds_;
  std::vector<QRectF> taken_;
};

}  // namespace helicarm::gui
