// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QColor>
#include <QPainter>
#include <cmath>

#include <Eigen/Core>

namespace helicarm::gui {

/// What moves a model: its middle shifts, the ring about it turns.
enum class HandlePart { none, middle, ring };

/// The handle of a model in an image.
struct ModelHandle {
  Eigen::Vector2d centre;  ///< rectified px
  QColor colour;
};

/// Of the ring, screen px.
inline constexpr double handle_radius = 46;

/// The part of a handle at `centre` under a place, both in screen px.
inline HandlePart handle_part(const QPointF& centre, const QPointF& place) {
  constexpr double reach = 10;
  const double off = std::hypot(place.x() - centre.x(), place.y() - centre.y());
  if (off <= 1.5 * reach) return HandlePart::middle;
  return std::abs(off - handle_radius) <= reach ? HandlePart::ring : HandlePart::none;
}

inline void paint_handle(QPainter& painter, const QPointF& at, const QColor& colour) {
  painter.setBrush(Qt::NoBrush);
  for (const QPen& pen : {QPen(QColor(0, 0, 0, 170), 5), QPen(colour, 2.4)}) {
    painter.setPen(pen);
    painter.drawEllipse(at, handle_radius, handle_radius);
    painter.drawEllipse(at, 9, 9);
    for (const QPointF& arm : {QPointF(1, 0), QPointF(0, 1), QPointF(-1, 0), QPointF(0, -1)})
      painter.drawLine(at + 9 * arm, at + 16 * arm);
  }
}

}  // namespace helicarm::gui
