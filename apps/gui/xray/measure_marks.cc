// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/measure_marks.h"

#include <cmath>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"
#include "gui/xray/marks.h"

namespace helicarm::gui {

void MeasureMarks::carry(const pipeline::ViewResult& view, Layer layer) {
  lines_.clear();
  clicks_.clear();
  words_.clear();
  const auto add_words = [&](const Eigen::Vector2d& at, const QString& text) {
    if (const auto place = in_layer(view, layer, at); place && !text.isEmpty())
      words_.push_back({*place, text});
  };
  for (const EvaluatedMeasure& measure : given_) {
    for (const measures::Stroke& stroke : measure.strokes)
      for (rectification::PixelPath& piece : in_layer(view, layer, stroke.path))
        lines_.push_back({std::move(piece), stroke.is_fine});
    for (std::size_t i = 0; i < measure.points.size(); ++i)
      if (const auto place = in_layer(view, layer, measure.points[i]))
        clicks_.push_back({measure.number, int(i), *place});
    if (!measure.points.empty()) add_words(measure.points.back(), measure.label);
    for (const auto& [at, text] : measure.positions) add_words(at, text);
  }
}

std::optional<ClickMark> MeasureMarks::click_near(const QPointF& place, double reach,
                                                  const ImageFrame& frame) const {
  std::optional<ClickMark> nearest;
  for (const ClickMark& click : clicks_) {
    const QPointF off = frame.to_widget(click.place) - place;
    const double distance = std::hypot(off.x(), off.y());
    if (distance > reach) continue;
    reach = distance;
    nearest = click;
  }
  return nearest;
}

void MeasureMarks::paint(QPainter& painter, const ImageFrame& frame) const {
  for (const auto& [path, is_fine] : lines_)
    paint_path(painter, path, frame, QPen(ink::measure, is_fine ? 1 : 2));
  for (const ClickMark& click : clicks_)
    paint_open_cross(painter, frame.to_widget(click.place), ink::measure);
  for (const auto& [at, text] : words_)
    outlined_text(painter, frame.to_widget(at) + QPointF(12, 18), text, ink::measure);
}

}  // namespace helicarm::gui
