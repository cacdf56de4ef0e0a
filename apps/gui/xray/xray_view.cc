// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/xray_view.h"

#include <QResizeEvent>
#include <algorithm>
#include <utility>

namespace helicarm::gui {
namespace {

/// Whether two views show the same pixels, so that zoom and window are kept.
bool same_image(const pipeline::ViewResult& a, const pipeline::ViewResult& b) {
  return a.xray_image && b.xray_image && a.name == b.name &&
         a.xray_image->acquisition.instance_key == b.xray_image->acquisition.instance_key &&
         a.xray_image->pixels.width() == b.xray_image->pixels.width() &&
         a.xray_image->pixels.height() == b.xray_image->pixels.height();
}

}  // namespace

XrayView::XrayView(QWidget* parent) : QWidget(parent) {
  setFocusPolicy(Qt::StrongFocus);
  setMouseTracking(true);
  setAttribute(Qt::WA_OpaquePaintEvent);
  connect(&loader_, &LayerLoader::loaded, this, &XrayView::take);
  clear(tr("No image yet"));
}

XrayView::~XrayView() = default;

void XrayView::show_view(std::shared_ptr<const pipeline::Result> result, std::size_t index, bool keeps_zoom) {
  if (!result || index >= result->views.size()) return clear(tr("No image yet"));
  const pipeline::ViewResult& next = result->views[index];
  const QString name = QString::fromStdString(next.name);
  if (!next.xray_image || next.xray_image->pixels.empty())
    return clear(name.isEmpty() ? tr("No image yet") : tr("No image yet: acquire %1").arg(name));
  const bool is_same = result_ && same_image(view(), next), stays = result_ && (keeps_zoom || is_same);
  // The previous layer stays until the new one is ready, to avoid flicker.
  const bool stands = stays && shown_ && layer_at_hand(next, shown_->layer) == shown_->layer;
  auto layer = stands ? shown_ : nullptr;
  QImage grey = stands ? grey_ : QImage();
  report::ViewMarks marks = marks_;
  clear({});
  result_ = std::move(result);
  view_ = index;
  if (stands) {
    shown_ = std::move(layer);
    grey_ = std::move(grey);
    shows_earlier_ = !is_same;
    marks_ = is_same ? marks_of(*result_, view_, shown_->layer) : std::move(marks);
  }
  if (!stays) {
    window_.reset();
    fits_ = true;
  }
  refusal_ = refusal_of(*result_, view_);
  setAccessibleName(tr("X-ray image %1").arg(name));
  computing_ = true;
  loader_.load(result_, view_, wanted_);
}

void XrayView::clear(const QString& why) {
  loader_.cancel();
  result_.reset();
  shown_.reset();
  grey_ = {};
  marks_ = {};
  live_ = {};
  picks_.clear();
  superseded_.clear();
  refusal_.reset();
  measures_ = {};
  handle_.reset();
  handle_in_layer_.reset();
  cursor_.reset();
  drag_ = {};
  computing_ = shows_earlier_ = false;
  why_empty_ = why;
  setAccessibleName(tr("X-ray"));
  setAccessibleDescription(why);
  hover_over({});
  redraw_still();
}

void XrayView::set_layer(Layer layer) {
  if (layer == wanted_) return;
  wanted_ = layer;
  if (result_) {
    computing_ = true;
    loader_.load(result_, view_, wanted_);
    update();
  }
  Q_EMIT layer_changed(layer);
}

void XrayView::take(const std::shared_ptr<const LoadedLayer>& layer) {
  computing_ = shows_earlier_ = false;
  if (!layer) return clear(tr("This layer cannot be computed"));
  if (cursor_ && shown_)
    if (const auto raw = raw_from_layer(view(), shown_->layer, *cursor_))
      cursor_ = layer_from_raw(view(), layer->layer, *raw);
  shown_ = layer;
  window_image();
  marks_ = marks_of(*result_, view_, shown_->layer);
  setAccessibleDescription(refusal_ ? refusal_->reason + " " + described(marks_) : described(marks_));
  if (fits_)
    fit();
  else
    Q_EMIT zoomed();
  live_.forget_layer();
  hide_repeated_picks();
  hover_over({});
  Q_EMIT shown();
}

std::optional<image::GreyWindow> XrayView::window() const {
  if (window_) return window_;
  return shown_ ? std::optional(shown_->usual) : std::nullopt;
}

void XrayView::set_window(image::GreyWindow window) {
  window_ = window;
  if (!shown_) return;
  window_image();
  Q_EMIT window_changed(window);
}

void XrayView::set_usual_window() {
  if (!shown_) return window_.reset();
  set_window(shown_->usual);
  window_.reset();
}

void XrayView::set_picking(bool picking) {
  if (std::exchange(picking_, picking) != picking) drag_ = {};
  setCursor(takes_clicks() ? Qt::CrossCursor : Qt::ArrowCursor);
  update();
}

void XrayView::set_measuring(bool measuring) {
  if (std::exchange(measuring_, measuring) != measuring) drag_ = {};
  setCursor(takes_clicks() ? Qt::CrossCursor : Qt::ArrowCursor);
}

void XrayView::set_measures(std::vector<EvaluatedMeasure> measures) {
  measures_.set(std::move(measures));
  carry_live();
}

void XrayView::set_marks_visible(bool visible) {
  marks_visible_ = visible;
  redraw_still();
}

void XrayView::set_magnifier(bool on) {
  magnifier_ = on;
  update();
}

void XrayView::set_epipolar(std::vector<rectification::PixelPath> rectified) {
  live_.set_epipolar(std::move(rectified));
  carry_live();
}

void XrayView::set_path(std::vector<Eigen::Vector2d> rectified) {
  live_.set_path(std::move(rectified));
  carry_live();
}

void XrayView::set_outlines(std::vector<ModelOutline> rectified) {
  live_.set_outlines(std::move(rectified));
  carry_live();
}

void XrayView::set_handle(const std::optional<ModelHandle>& rectified) {
  if (!rectified && !handle_) return;
  handle_ = rectified;
  carry_live();
}

void XrayView::set_tool(const std::optional<guidance::ImageLine>& rectified, const QString& note) {
  if (!rectified && !live_.has_tool()) return;
  live_.set_tool(rectified, note);
  carry_live();
}

void XrayView::set_picks(std::vector<FreshPick> raw) {
  picks_ = std::move(raw);
  hide_repeated_picks();
}

/// A pick that the result shows is not drawn twice; of one that has moved only the new place is.
void XrayView::hide_repeated_picks() {
  constexpr double reach_px = 12;  // raw; a snapped pick is off its click
  std::set<std::string> moved;
  std::vector<FreshPick> fresh;
  for (const FreshPick& pick : picks_) {
    const std::string name = pick.name.toStdString();
    const auto mark = std::ranges::find(marks_.points, name, &report::PointMark::name);
    const bool is_old = stale_.contains(name), is_marked = mark != marks_.points.end() && shown_;
    const auto raw = is_marked ? raw_from_layer(view(), shown_->layer, mark->place) : std::nullopt;
    if (raw && !is_old && (*raw - pick.raw).norm() < reach_px && pick.why_failed.isEmpty()) continue;
    if (is_marked) moved.insert(name);
    fresh.push_back(pick);
  }
  live_.set_picks(std::move(fresh));
  moved.insert(stale_.begin(), stale_.end());
  if (moved != superseded_) {
    superseded_ = std::move(moved);
    redraw_still();
  }
  carry_live();
}

void XrayView::set_mark_groups(MarkGroups groups) {
  groups_ = groups;
  redraw_still();
}

void XrayView::set_given_pixels(const QString& words) {
  if (std::exchange(given_pixels_, words) != words) update();
}

void XrayView::set_notice(const QString& notice) {
  if (std::exchange(notice_, notice) != notice) update();
}

void XrayView::set_stale_points(const std::set<std::string>& points) {
  if (std::exchange(stale_, points) != points) hide_repeated_picks();
}

void XrayView::set_residual_scale(const ResidualScale& scale) {
  if (std::exchange(residual_scale_, scale) != std::optional(scale)) redraw_still();
}

QString XrayView::refusal() const {
  if (!refusal_) return {};
  return details_visible_ ? refusal_->reason + '\n' + refusal_->details : refusal_->reason;
}

void XrayView::set_details_visible(bool visible) {
  details_visible_ = visible;
  update();
}

void XrayView::window_image() {
  // Qt scales this format three times as fast as grey.
  grey_ = windowed(shown_->pixels, *window()).convertToFormat(QImage::Format_RGB32);
  redraw_still();
}

void XrayView::carry_live() {
  if (shown_) {
    live_.carry(view(), shown_->layer);
    measures_.carry(view(), shown_->layer);
    handle_in_layer_ = handle_ ? in_layer(view(), shown_->layer, handle_->centre) : std::nullopt;
  }
  update();
}

QSizeF XrayView::image_size() const { return shown_ ? QSizeF(grey_.size()) : QSizeF(1, 1); }

std::optional<QPointF> XrayView::raw_at(const QPointF& place) const {
  if (!shown_ || shows_earlier_) return std::nullopt;
  const auto raw = raw_from_layer(view(), shown_->layer, frame_.to_image(place));
  return raw ? std::optional(QPointF(raw->x(), raw->y())) : std::nullopt;
}

std::optional<QPointF> XrayView::place_of(const QPointF& raw_pixel) const {
  if (!shown_) return std::nullopt;
  const auto pixel = layer_from_raw(view(), shown_->layer, {raw_pixel.x(), raw_pixel.y()});
  return pixel ? std::optional(frame_.to_widget(*pixel)) : std::nullopt;
}

void XrayView::fit() {
  fits_ = true;
  frame_ = ImageFrame::fitted(image_size(), size());
  redraw_still();
  Q_EMIT zoomed();
}

void XrayView::resizeEvent(QResizeEvent* event) {
  if (fits_) return fit();
  const QSizeF grown = event->size() - event->oldSize();
  pan({0.5 * grown.width(), 0.5 * grown.height()});
}

void XrayView::redraw_still() {
  still_ = {};
  update();
}

}  // namespace helicarm::gui
