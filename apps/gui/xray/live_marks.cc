// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/live_marks.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"

namespace helicarm::gui {
namespace {

void paint_pick(QPainter& painter, const QPointF& at, const QString& name) {
  for (const QPen& pen : {QPen(QColor(0, 0, 0, 170), 3.6), QPen(ink::point, 1.6)}) {
    painter.setPen(pen);
    painter.drawEllipse(at, 9, 9);
    for (const QPointF& arm : {QPointF(1, 0), QPointF(0, 1), QPointF(-1, 0), QPointF(0, -1)})
      painter.drawLine(at + 5 * arm, at + 13 * arm);
  }
  outlined_text(painter, at + QPointF(13, -9), name, ink::point);
}

/// Unlike a pick in shape and colour, with the reason beside it.
void paint_failed(QPainter& painter, const QPointF& at, const FreshPick& pick, const QRectF& bounds) {
  constexpr double arm = 7;
  for (const QPen& pen : {QPen(QColor(0, 0, 0, 170), 4), QPen(ink::rejected, 2)}) {
    painter.setPen(pen);
    painter.drawLine(at + QPointF(-arm, -arm), at + QPointF(arm, arm));
    painter.drawLine(at + QPointF(-arm, arm), at + QPointF(arm, -arm));
  }
  painter.setPen(QPen(ink::rejected, 1.6, Qt::DashLine));
  painter.drawEllipse(at, 13, 13);
  wrapped_box(painter, at, QObject::tr("%1 is not picked: %2").arg(pick.name, pick.why_failed), bounds,
              ink::rejected);
}

}  // namespace

void LiveMarks::set_epipolar(std::vector<rectification::PixelPath> rectified) {
  epipolar_.clear();
  for (rectification::PixelPath& line : rectified) epipolar_.push_back({std::move(line)});
}

void LiveMarks::set_tool(const std::optional<guidance::ImageLine>& rectified, const QString& note) {
  tool_ = {rectified ? rectification::PixelPath{rectified->back, rectified->tip}
                     : rectification::PixelPath{}};
  note_ = note;
}

void LiveMarks::set_picks(std::vector<FreshPick> raw) {
  picks_.clear();
  for (FreshPick& pick : raw) picks_.push_back({std::move(pick), {}});
}

void LiveMarks::set_outlines(std::vector<ModelOutline> rectified) {
  outlines_.clear();
  for (ModelOutline& outline : rectified) outlines_.push_back({std::move(outline)});
}

void LiveMarks::set_moved(std::optional<FreshPick> raw) {
  moved_.reset();
  if (raw) moved_ = CarriedPick{*std::move(raw), {}};
}

void LiveMarks::forget_layer() {
  for (Carried& line : epipolar_) line.is_carried = false;
  for (Carried* one : {&path_, &tool_}) one->is_carried = false;
  for (CarriedOutline& outline : outlines_) outline.is_carried = false;
  for (CarriedPick& pick : picks_) pick.in_layer.reset();
}

namespace {

bool is_inside(const pipeline::ViewResult& view, const Eigen::Vector2d& place) {
  const image::Image<float>& pixels = view.xray_image->pixels;
  return pixels.contains(int(std::lround(place.x())), int(std::lround(place.y())));
}

}  // namespace

void LiveMarks::carry(const pipeline::ViewResult& view, Layer layer) {
  const auto carry_one = [&](Carried& one) {
    if (std::exchange(one.is_carried, true)) return;
    one.in_layer = in_layer(view, layer, one.given);
    one.end = one.given.empty() ? std::nullopt : in_layer(view, layer, one.given.back());
  };
  for (Carried& line : epipolar_) carry_one(line);
  for (Carried* one : {&path_, &tool_}) carry_one(*one);
  for (CarriedOutline& outline : outlines_) {
    if (std::exchange(outline.is_carried, true)) continue;
    outline.in_layer = {};
    for (const Eigen::Vector2d& dot : outline.given.dots)
      if (const auto place = in_layer(view, layer, dot); place && is_inside(view, *place))
        outline.in_layer.dots.push_back(*place);
    for (const auto& [name, at] : outline.given.points)
      if (const auto place = in_layer(view, layer, at)) outline.in_layer.points.emplace_back(name, *place);
    for (const OutlinedTunnel& tunnel : outline.given.tunnels)
      for (rectification::PixelPath& piece : in_layer(view, layer, tunnel.path))
        outline.in_layer.tunnels.push_back({std::move(piece), tunnel.warns});
  }
  for (CarriedPick& pick : picks_)
    if (!pick.in_layer) pick.in_layer = layer_from_raw(view, layer, pick.given.raw);
  if (moved_) moved_->in_layer = layer_from_raw(view, layer, moved_->given.raw);
}

namespace {

/// Unlike a picked tunnel in stroke and colour.
void paint_planned_tunnel(QPainter& painter, const rectification::PixelPath& tunnel, const ImageFrame& frame,
                          const QColor& colour) {
  paint_path(painter, tunnel, frame, QPen(QColor(0, 0, 0, 200), 3));
  paint_path(painter, tunnel, frame, QPen(colour, 2.4, Qt::DashLine));
}

void paint_outline(QPainter& painter, const ModelOutline& outline, const ImageFrame& frame,
                   const QColor& colour, LabelPlacer& labels) {
  QList<QPointF> dots;
  for (const Eigen::Vector2d& dot : outline.dots) dots.append(frame.to_widget(dot));
  painter.setPen(QPen(colour, 2));
  painter.drawPoints(dots.data(), int(dots.size()));
  for (const OutlinedTunnel& tunnel : outline.tunnels)
    paint_planned_tunnel(painter, tunnel.path, frame, tunnel.warns.value_or(colour));
  constexpr double arm = 10;
  for (const auto& [name, at] : outline.points) {
    const QPointF place = frame.to_widget(at);
    labels.keep_free({place - QPointF(arm, arm), QSizeF(2 * arm, 2 * arm)});
    paint_open_cross(painter, place, colour, 4, arm);
  }
  for (const auto& [name, at] : outline.points) labels.place(painter, frame.to_widget(at), arm, name, colour);
}

}  // namespace

void LiveMarks::paint(QPainter& painter, const ImageFrame& frame, const QRectF& bounds) const {
  for (const Carried& line : epipolar_)
    for (const rectification::PixelPath& piece : line.in_layer)
      paint_path(painter, piece, frame, QPen(ink::epipolar, 1.6, Qt::DashLine));
  for (const rectification::PixelPath& piece : path_.in_layer)
    paint_path(painter, piece, frame, QPen(ink::residual, 2.2));
  LabelPlacer labels(bounds);
  for (std::size_t i = 0; i < outlines_.size(); ++i)
    paint_outline(painter, outlines_[i].in_layer, frame, ink::of_model(i), labels);
  painter.setBrush(ink::residual);
  painter.setPen(Qt::NoPen);
  if (path_.end) painter.drawEllipse(frame.to_widget(*path_.end), 4, 4);
  for (const rectification::PixelPath& piece : tool_.in_layer)
    paint_path(painter, piece, frame, QPen(ink::tool, 3));
  painter.setBrush(Qt::NoBrush);
  if (tool_.end) {
    const QPointF at = frame.to_widget(*tool_.end);
    for (const QPen& pen : {QPen(QColor(0, 0, 0, 170), 4), QPen(QColor(255, 255, 255), 2)}) {
      painter.setPen(pen);
      painter.drawEllipse(at, 6, 6);
    }
    if (!note_.isEmpty()) outlined_text(painter, at + QPointF(12, 18), note_, QColor(255, 255, 255));
  }
  for (const auto& [pick, place] : picks_) {
    if (!place || (moved_ && moved_->given.name == pick.name)) continue;
    if (pick.why_failed.isEmpty())
      paint_pick(painter, frame.to_widget(*place), pick.name);
    else
      paint_failed(painter, frame.to_widget(*place), pick, bounds);
  }
  if (moved_ && moved_->in_layer) paint_pick(painter, frame.to_widget(*moved_->in_layer), moved_->given.name);
}

}  // namespace helicarm::gui
