// SPDX-License-Identifier: Apache-2.0
// SceneView navigation: presets, mouse and keys.
#include <QKeyEvent>
#include <QMouseEvent>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>
#include <utility>

#include "gui/scene/scene_view.h"

namespace helicarm::gui {
namespace {

constexpr double turn_per_pixel = 0.008, zoom_per_pixel = 1.008;
constexpr double turn_per_key = 0.09, zoom_per_key = 1.15;

}  // namespace

const ViewShape* SceneView::view_of(Preset preset) const {
  if (preset == Preset::free) return nullptr;
  const QString start = preset == Preset::ap ? QStringLiteral("ap") : QStringLiteral("lat");
  for (const ViewShape& view : scene_.views)
    if (QString::fromStdString(view.name).startsWith(start, Qt::CaseInsensitive)) return &view;
  const std::size_t number = preset == Preset::ap ? 0 : 1;
  return number < scene_.views.size() ? &scene_.views[number] : nullptr;
}

SceneCamera SceneView::camera_of(Preset preset) const {
  if (const ViewShape* view = view_of(preset)) return camera_through(*view, middle_, aspect());
  std::vector<Eigen::Vector3d> places;
  for (const phantom::CalibratorBall& ball : scene_.balls) places.push_back(ball.centre_in_calibrator);
  for (const ViewShape& view : scene_.views) {
    places.push_back(view.central_ray.from);
    places.insert(places.end(), view.detector.begin(), view.detector.end());
  }
  if (live_.calibrator_from_base && live_.joints) places.push_back(live_.calibrator_from_base->translation);
  return overview_of(places, aspect());
}

void SceneView::set_preset(Preset preset) {
  const bool fresh = preset != preset_;
  preset_ = preset;
  moved_ = false;
  camera_ = camera_of(preset);
  redraw();
  if (fresh) emit preset_changed(preset);
}

SceneCamera SceneView::near_camera() const {
  std::vector<Eigen::Vector3d> places;
  for (const phantom::CalibratorBall& ball : scene_.balls) places.push_back(ball.centre_in_calibrator);
  for (const PointShape& point : scene_.points) places.push_back(point.error.centre);
  constexpr double shown_mm = 100;  // about what the views show, without a calibrator
  if (places.size() < 2 && !scene_.views.empty())
    for (const double side : {-shown_mm, shown_mm})
      places.push_back(middle_ + Eigen::Vector3d::Constant(side));
  if (live_.calibrator_from_tip) places.push_back(live_.calibrator_from_tip->translation);
  constexpr double scene_around = 0.72;
  return zoomed(overview_of(places, aspect()), scene_around);
}

void SceneView::look_near() { move_camera(near_camera()); }

void SceneView::look_at_robot() {
  std::vector<Eigen::Vector3d> places;
  for (const phantom::CalibratorBall& ball : scene_.balls) places.push_back(ball.centre_in_calibrator);
  for (const DrawnLink& link : drawn_links(live_))
    for (const Eigen::Vector3d& end : {link.axis.from, link.axis.to}) places.push_back(end);
  if (live_.calibrator_from_tip) places.push_back(live_.calibrator_from_tip->translation);
  move_camera(overview_of(places, aspect()));
}

void SceneView::set_handle(const std::optional<Handle>& handle) {
  if (!handle && !handle_) return;
  handle_ = handle;
  update();
}

std::optional<QPointF> SceneView::handle_place() const {
  if (!handle_) return {};
  const auto at = seen_at(camera_, aspect(), handle_->place);
  if (!at || at->cwiseAbs().maxCoeff() > 1) return {};
  return QPointF((at->x() + 1) / 2 * width(), (1 - at->y()) / 2 * height());
}

/// Across the line of sight at the handle's depth, or about the line of sight through it.
void SceneView::drag_handle(const QPointF& from, const QPointF& to) {
  const auto centre = handle_place();
  if (!centre) return;
  const bool continues = std::exchange(has_dragged_, true);
  const Eigen::Vector3d off = handle_->place - camera_.position;
  if (dragged_ == HandlePart::middle) {
    const double mm_per_px = 2 * std::tan(camera_.height_deg * EIGEN_PI / 360) * off.dot(camera_.forward()) /
                             std::max(1, height());
    const QPointF by = mm_per_px * (to - from);
    emit handle_shifted(by.x() * camera_.right() - by.y() * camera_.up, continues);
  } else {
    const QPointF a = from - *centre, b = to - *centre;
    const double angle = std::atan2(a.x() * b.y() - a.y() * b.x(), QPointF::dotProduct(a, b));
    emit handle_turned(angle * off.normalized(), continues);
  }
}

void SceneView::move_camera(const SceneCamera& camera) {
  camera_ = camera;
  moved_ = true;
  redraw();
  if (std::exchange(preset_, Preset::free) != Preset::free) emit preset_changed(Preset::free);
}

void SceneView::mousePressEvent(QMouseEvent* event) {
  mouse_ = event->position();
  const auto handle = handle_place();
  dragged_ = handle && event->button() == Qt::LeftButton ? handle_part(*handle, mouse_) : HandlePart::none;
  has_dragged_ = false;
}

void SceneView::mouseMoveEvent(QMouseEvent* event) {
  const QPointF way = event->position() - mouse_;
  const QPointF from = std::exchange(mouse_, event->position());
  if (dragged_ != HandlePart::none && (event->buttons() & Qt::LeftButton)) return drag_handle(from, mouse_);
  if (event->buttons() & Qt::LeftButton)
    move_camera(turned(camera_, turn_per_pixel * way.x(), -turn_per_pixel * way.y()));
  else if (event->buttons() & Qt::RightButton)
    move_camera(zoomed(camera_, std::pow(zoom_per_pixel, -way.y())));
  else if (event->buttons() & Qt::MiddleButton)
    move_camera(shifted(camera_, way.x() / std::max(1, height()), -way.y() / std::max(1, height())));
}

void SceneView::wheelEvent(QWheelEvent* event) {
  constexpr double notch = 120;  // eighths of a degree
  move_camera(zoomed(camera_, std::pow(zoom_per_key, event->angleDelta().y() / notch)));
  event->accept();
}

void SceneView::keyPressEvent(QKeyEvent* event) {
  switch (event->key()) {
    case Qt::Key_1:
      return set_preset(Preset::ap);
    case Qt::Key_2:
      return set_preset(Preset::lateral);
    case Qt::Key_3:
      return set_preset(Preset::free);
    case Qt::Key_4:
      return look_near();
    case Qt::Key_R:
      return set_preset(preset_);
    case Qt::Key_Left:
      return move_camera(turned(camera_, -turn_per_key, 0));
    case Qt::Key_Right:
      return move_camera(turned(camera_, turn_per_key, 0));
    case Qt::Key_Up:
      return move_camera(turned(camera_, 0, turn_per_key));
    case Qt::Key_Down:
      return move_camera(turned(camera_, 0, -turn_per_key));
    case Qt::Key_Plus:
    case Qt::Key_Equal:
      return move_camera(zoomed(camera_, zoom_per_key));
    case Qt::Key_Minus:
      return move_camera(zoomed(camera_, 1 / zoom_per_key));
    default:
      QWidget::keyPressEvent(event);
  }
}

}  // namespace helicarm::gui
