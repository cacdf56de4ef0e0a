// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/marks.h"

#include <QObject>
#include <algorithm>
#include <cmath>

#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;
using MarkKind = MarkUnderCursor::Kind;

/// Whether the layer's pixels differ from the raw ones.
bool is_mapped(const pipeline::ViewResult& view, Layer layer) {
  return view.rectification && layer != Layer::raw;
}

QString tip_of(const report::BallMark& ball) {
  QString tip = QString::fromStdString(ball.label);
  if (!ball.used) tip += QObject::tr("  rejected");
  tip += QObject::tr("\nσ %1 px").arg(fixed(ball.sigma_px, 3));
  if (ball.residual) tip += QObject::tr("\nresidual %1 px").arg(fixed(ball.residual->norm(), 3));
  return tip;
}

QString tip_of(const report::PointMark& point) {
  QString tip = QString::fromStdString(point.name);
  tip += point.source == localization::PointSource::target ? QObject::tr("  check target")
                                                           : QObject::tr("  pick");
  if (point.error_95_mm && std::isfinite(*point.error_95_mm))
    tip += QObject::tr("\nwithin %1 mm (95 %)").arg(fixed(*point.error_95_mm, 2));
  else
    tip += QObject::tr("\nnot located");
  if (!point.reason.empty()) tip += "\n" + QString::fromStdString(point.reason);
  return tip;
}

QString tip_of(const report::DotMark& candidate) {
  return QObject::tr("like a fiducial, without a label\nradius %1 px").arg(fixed(candidate.radius_px, 1));
}

}  // namespace

report::ViewMarks marks_of(const pipeline::Result& result, std::size_t view, Layer layer) {
  report::ViewMarks marks = report::marks_of(result, view);
  const auto& rectification = result.views[view].rectification;
  return rectification && layer == Layer::raw ? report::raw_marks(marks, rectification->map) : marks;
}

std::optional<Vector2d> in_layer(const pipeline::ViewResult& view, Layer layer, const Vector2d& rectified) {
  if (!view.rectification || layer != Layer::raw) return rectified;
  return rectification::raw_in_image(view.rectification->map, rectified);
}

std::vector<rectification::PixelPath> in_layer(const pipeline::ViewResult& view, Layer layer,
                                               const rectification::PixelPath& rectified) {
  if (view.rectification && layer == Layer::raw)
    return rectification::raw_paths(view.rectification->map, rectified);
  if (!view.xray_image) return {};
  const image::Image<float>& pixels = view.xray_image->pixels;
  return rectification::raw_paths(rectification::identity_map(pixels.width(), pixels.height(), {}),
                                  rectified);
}

std::optional<Vector2d> raw_from_layer(const pipeline::ViewResult& view, Layer layer, const Vector2d& place) {
  if (is_mapped(view, layer)) return rectification::raw_in_image(view.rectification->map, place);
  if (!view.xray_image) return std::nullopt;
  const image::Image<float>& pixels = view.xray_image->pixels;
  const bool inside = place.x() >= -0.5 && place.y() >= -0.5 && place.x() <= pixels.width() - 0.5 &&
                      place.y() <= pixels.height() - 0.5;
  return inside ? std::optional(place) : std::nullopt;
}

std::optional<Vector2d> layer_from_raw(const pipeline::ViewResult& view, Layer layer, const Vector2d& raw) {
  return is_mapped(view, layer) ? rectification::rectified_in_image(view.rectification->map, raw)
                                : std::optional(raw);
}

std::optional<MarkUnderCursor> mark_near(const report::ViewMarks& marks, const Vector2d& place,
                                         double reach_px) {
  std::optional<MarkUnderCursor> nearest;
  const auto consider = [&](const auto& some, MarkKind kind, const auto& name_of) {
    for (std::size_t i = 0; i < some.size(); ++i) {
      const double distance = (some[i].place - place).norm();
      if (!(distance <= reach_px)) continue;
      reach_px = distance;
      nearest =
          MarkUnderCursor{kind, some[i].place, QString::fromStdString(name_of(some[i])), tip_of(some[i])};
    }
  };
  const auto no_name = [](const report::DotMark&) { return std::string(); };
  consider(marks.candidates, MarkKind::candidate, no_name);
  consider(marks.false_blobs, MarkKind::candidate, no_name);
  consider(marks.balls, MarkKind::ball, [](const report::BallMark& ball) { return ball.label; });
  consider(marks.points, MarkKind::point, [](const report::PointMark& point) { return point.name; });
  return nearest;
}

QString described(const report::ViewMarks& marks) {
  const auto used = std::ranges::count(marks.balls, true, &report::BallMark::used);
  QString words = QObject::tr("%1 fiducials used, %2 rejected, %3 outliers, %4 points.")
                      .arg(used)
                      .arg(marks.balls.size() - static_cast<std::size_t>(used))
                      .arg(marks.false_blobs.size())
                      .arg(marks.points.size());
  if (!marks.candidates.empty())
    words += QObject::tr(" Refused: %1 candidates, %2 of them with a guessed label.")
                 .arg(marks.candidates.size())
                 .arg(marks.guessed.size());
  if (const double largest = report::largest_residual(marks); largest > 0)
    words += QObject::tr(" Largest residual %1 px.").arg(fixed(largest, 3));
  return words;
}

}  // namespace helicarm::gui
