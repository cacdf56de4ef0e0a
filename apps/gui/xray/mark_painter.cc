// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/mark_painter.h"

#include <QObject>
#include <QPolygonF>
#include <algorithm>
#include <cmath>

#include "gui/xray/label_placer.h"
#include "helicarm/report/rectified_image.h"

namespace helicarm::gui {
namespace {

QPointF as_point(const Eigen::Vector2d& v) { return {v.x(), v.y()}; }

QRectF square(const QPointF& centre, double half) {
  return {centre - QPointF(half, half), QSizeF(2 * half, 2 * half)};
}

void cross(QPainter& painter, const QPointF& at, double arm) {
  painter.drawLine(at + QPointF(-arm, -arm), at + QPointF(arm, arm));
  painter.drawLine(at + QPointF(-arm, arm), at + QPointF(arm, -arm));
}

/// Draws twice: a dark edge, then the line.
template <class Shape>
void edged(QPainter& painter, const QPen& pen, const Shape& shape) {
  painter.setBrush(Qt::NoBrush);
  QPen edge = pen;
  edge.setColor(QColor(0, 0, 0, 150));
  edge.setWidthF(pen.widthF() + 2);
  edge.setStyle(Qt::SolidLine);
  if (pen.style() == Qt::SolidLine) {
    painter.setPen(edge);
    shape();
  }
  painter.setPen(pen);
  shape();
}

void arrow(QPainter& painter, const QPointF& from, const QPointF& way) {
  edged(painter, QPen(ink::residual, 1.8), [&] {
    const QPointF to = from + way;
    painter.drawLine(from, to);
    const double length = std::hypot(way.x(), way.y());
    if (length < 4) return;
    const QPointF back = -std::min(7.0, 0.5 * length) / length * way;
    const QPointF side(-0.5 * back.y(), 0.5 * back.x());
    painter.drawLine(to, to + back + side);
    painter.drawLine(to, to + back - side);
  });
}

/// Marks of constant screen size, except at very large zoom.
double ball_radius(const ImageFrame& frame, int image_width) {
  return std::max(8.0, 15 / 1024.0 * image_width * frame.scale);
}

/// Beside the disc, which stays visible: it may be what is to be picked.
void ticks_around(QPainter& painter, const QPointF& at, double disc) {
  const double from = std::sqrt(0.5) * (disc + 3), to = from + 5;
  for (const QPointF& way : {QPointF(1, 1), QPointF(-1, 1), QPointF(-1, -1), QPointF(1, -1)})
    painter.drawLine(at + from * way, at + to * way);
}

/// Of a view whose labelling was refused: what may be a fiducial, and which of them the best labelling names.
void paint_candidates(QPainter& painter, const report::ViewMarks& marks, const ImageFrame& frame,
                      double radius) {
  for (const report::DotMark& candidate : marks.candidates)
    edged(painter, QPen(ink::residual, 1.6),
          [&] { painter.drawEllipse(frame.to_widget(candidate.place), radius, radius); });
  for (const report::BallMark& guess : marks.guessed)
    edged(painter, QPen(ink::residual, 1.6),
          [&] { painter.drawEllipse(frame.to_widget(guess.place), 0.6 * radius, 0.6 * radius); });
}

void paint_balls(QPainter& painter, const report::ViewMarks& marks, const ImageFrame& frame, double radius) {
  for (const report::BallMark& ball : marks.balls) {
    const QPointF at = frame.to_widget(ball.place);
    if (ball.used)
      edged(painter, QPen(ink::ball, 1.6), [&] { painter.drawEllipse(at, radius, radius); });
    else
      edged(painter, QPen(ink::rejected, 1.8), [&] {
        painter.drawRect(square(at, radius));
        cross(painter, at, radius);
      });
  }
}

/// Residual arrows of the fiducials and their scale bar.
void paint_residuals(QPainter& painter, const report::ViewMarks& marks, const ImageFrame& frame,
                     const ResidualScale& scale, const QRectF& bounds, LabelPlacer& labels) {
  if (!(report::largest_residual(marks) > 0 && scale.magnification > 0)) return;
  const double enlarged = scale.magnification * frame.scale, length = scale.bar_px;
  for (const report::BallMark& ball : marks.balls)
    if (ball.used && ball.residual) {
      const QPointF at = frame.to_widget(ball.place), way = enlarged * as_point(*ball.residual);
      arrow(painter, at, way);
      labels.keep_free(QRectF(at, at + way).normalized().adjusted(-2, -2, 2, 2));
    }
  const QPointF left = bounds.bottomLeft() + QPointF(14, -14), right = left + QPointF(length * enlarged, 0);
  edged(painter, QPen(ink::residual, 2), [&] {
    painter.drawLine(left, right);
    for (const QPointF& end : {left, right}) painter.drawLine(end + QPointF(0, -4), end + QPointF(0, 4));
  });
  outlined_text(painter, left + QPointF(-2, -9),
                QObject::tr("residuals × %1, %2 px").arg(scale.magnification).arg(length), ink::residual);
}

void paint_point(QPainter& painter, const report::PointMark& point, const QPointF& at) {
  constexpr double arm = 6;
  const QPen pen(ink::point, 1.8, point.error_95_mm ? Qt::SolidLine : Qt::DotLine);
  edged(painter, pen, [&] {
    cross(painter, at, arm);
    if (!point.error_95_mm) painter.drawEllipse(at, arm + 3, arm + 3);
  });
}

}  // namespace

void paint_open_cross(QPainter& painter, const QPointF& at, const QColor& colour, double gap, double arm) {
  for (const QPen& pen : {QPen(QColor(0, 0, 0, 180), 3), QPen(colour, 1.2)}) {
    painter.setPen(pen);
    for (const QPointF& way : {QPointF(1, 0), QPointF(0, 1), QPointF(-1, 0), QPointF(0, -1)})
      painter.drawLine(at + gap * way, at + arm * way);
  }
}

void paint_path(QPainter& painter, const rectification::PixelPath& path, const ImageFrame& frame,
                const QPen& pen) {
  QPolygonF line;
  for (const Eigen::Vector2d& place : path) line << frame.to_widget(place);
  edged(painter, pen, [&] { painter.drawPolyline(line); });
}

void paint_marks(QPainter& painter, const report::ViewMarks& marks, const ImageFrame& frame, int image_width,
                 const QRectF& bounds, const ResidualScale& residuals) {
  const double radius = ball_radius(frame, image_width);
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(ink::plate, 1));
  for (const report::DotMark& dot : marks.plate_dots) {
    const double size = std::max(2.0, dot.radius_px * frame.scale);
    painter.drawEllipse(frame.to_widget(dot.place), size, size);
  }
  for (const rectification::PixelPath& tunnel : marks.tunnels)
    paint_path(painter, tunnel, frame, QPen(ink::tunnel, 1.8));
  for (const rectification::PixelPath& tool : marks.tool_lines)
    paint_path(painter, tool, frame, QPen(ink::tool, 1.6, Qt::DashDotLine));
  for (const report::DotMark& blob : marks.false_blobs)
    edged(painter, QPen(ink::rejected, 1.6),
          [&] { ticks_around(painter, frame.to_widget(blob.place), blob.radius_px * frame.scale); });
  paint_candidates(painter, marks, frame, radius);
  paint_balls(painter, marks, frame, radius);
  for (const report::PointMark& point : marks.points)
    paint_point(painter, point, frame.to_widget(point.place));

  LabelPlacer labels(bounds);
  labels.keep_free({bounds.bottomLeft() + QPointF(0, -44), QSizeF(220, 44)});  // the scale bar
  for (const report::BallMark& ball : marks.balls)
    labels.keep_free(square(frame.to_widget(ball.place), 0.8 * radius));
  for (const report::PointMark& point : marks.points)
    labels.keep_free(square(frame.to_widget(point.place), 6));
  paint_residuals(painter, marks, frame, residuals, bounds, labels);
  for (const report::BallMark& ball : marks.balls)
    labels.place(painter, frame.to_widget(ball.place), radius, QString::fromStdString(ball.label),
                 ball.used ? ink::ball : ink::rejected);
  for (const report::BallMark& guess : marks.guessed)
    labels.place(painter, frame.to_widget(guess.place), radius, QString::fromStdString(guess.label),
                 ink::residual);
  for (const report::PointMark& point : marks.points)
    labels.place(painter, frame.to_widget(point.place), 8, QString::fromStdString(point.name), ink::point);
}

}  // namespace helicarm::gui
