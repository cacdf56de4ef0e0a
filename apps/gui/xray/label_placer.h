// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <vector>

namespace helicarm::gui {

inline constexpr int label_font_px = 13;

/// Text legible on any background: dark edge, bright fill, baseline at `at`.
void outlined_text(QPainter& painter, const QPointF& at, const QString& words, const QColor& colour);

/// A few lines in a dark box beside `at`, kept within `bounds`.
void text_box(QPainter& painter, const QPointF& at, const QString& words, const QRectF& bounds);

/// As `text_box`, wrapped at a readable width, with a coloured edge.
void wrapped_box(QPainter& painter, const QPointF& at, const QString& words, const QRectF& bounds,
                 const QColor& edge);

/// Places labels beside their marks without overlap of marks or labels where space permits.
class LabelPlacer {
 public:
  explicit LabelPlacer(const QRectF& bounds) : bounds_(bounds) {}

  /// An area to keep free of labels.
  void keep_free(const QRectF& area) { taken_.push_back(area); }
  /// Draws the label of a mark of this radius; marks outside the visible area are left out.
  void place(QPainter& painter, const QPointF& mark, double radius, const QString& words,
             const QColor& colour);

 private:
  double hidden_by(const QRectF& box) const;

  QRectF bounds_;
  std::vector<QRectF> taken_;
};

}  // namespace helicarm::gui
