// SPDX-License-Identifier: Apache-2.0
#include <QGuiApplication>
#include <QKeyEvent>
#include <QMouseEvent>
#include <QStyleHints>
#include <QWheelEvent>
#include <cmath>

#include "gui/xray/xray_view.h"

namespace helicarm::gui {
namespace {

constexpr double key_zoom = 1.25;

std::optional<QPointF> way_of(int key) {
  switch (key) {
    case Qt::Key_Left:
      return QPointF(-1, 0);
    case Qt::Key_Right:
      return QPointF(1, 0);
    case Qt::Key_Up:
      return QPointF(0, -1);
    case Qt::Key_Down:
      return QPointF(0, 1);
    default:
      return std::nullopt;
  }
}

}  // namespace

void XrayView::zoom(double factor, const QPointF& about) {
  if (!shown_) return;
  const double smallest = 0.5 * ImageFrame::fitted(image_size(), size()).scale;
  fits_ = false;
  frame_ = frame_.zoomed(factor, about, smallest).within(image_size(), size());
  redraw_still();
  Q_EMIT zoomed();
}

void XrayView::pan(const QPointF& by) {
  if (!shown_) return;
  fits_ = false;
  frame_.origin += by;
  frame_ = frame_.within(image_size(), size());
  redraw_still();
}

void XrayView::adjust_window(const QPointF& by) {
  const auto now = window();
  if (!now || !shown_) return;
  const double width = std::max(1e-6, double(now->high) - now->low);
  const double middle = 0.5 * (double(now->low) + now->high) - width * by.y() / 300;
  const double widened = width * std::exp(by.x() / 200);
  set_window({float(middle - 0.5 * widened), float(middle + 0.5 * widened)});
}

void XrayView::wheelEvent(QWheelEvent* event) {
  zoom(std::pow(1.0015, event->angleDelta().y()), event->position());
  hover_at(event->position());
  event->accept();
}

void XrayView::mousePressEvent(QMouseEvent* event) {
  const bool left = event->button() == Qt::LeftButton;
  if (left && shows_refusal() && refusal_box().contains(event->position()))
    return set_details_visible(!details_visible_);
  cursor_.reset();
  drag_ = {event->button(), event->position(), event->position()};
  drag_.may_pick = takes_clicks() && left;
  constexpr double reach = 12;  // screen px
  if (left && measuring_)
    drag_.click = measures_.click_near(event->position(), reach, frame_);
  else if (left)
    drag_.pick = movable_at(event->position());
  if (left && !measuring_ && drag_.pick.isEmpty()) drag_.handle = handle_at(event->position());
  if (drag_.handle != HandlePart::none) drag_.may_pick = false;
  update();
}

void XrayView::mouseMoveEvent(QMouseEvent* event) {
  const QPointF at = event->position(), by = at - drag_.last;
  mouse_ = at;
  if (drag_.button != Qt::NoButton && !(event->buttons() & drag_.button)) drag_ = {};
  const int threshold = QGuiApplication::styleHints()->startDragDistance();
  if ((at - drag_.from).manhattanLength() >= threshold) drag_.moved = true;
  if (drag_.button != Qt::NoButton && drag_.moved) {
    drag_.last = at;
    if (drag_.handle != HandlePart::none) return move_handle(at - by, at);
    if (!drag_.pick.isEmpty()) return show_moved(raw_at(at));
    if (drag_.click) return move_click(at);
    if (drag_.button == Qt::RightButton) return adjust_window(by);
    if (drag_.button == Qt::MiddleButton || !takes_clicks()) return pan(by);
  }
  hover_at(at);
  if (magnifier_) update();
}

void XrayView::mouseReleaseEvent(QMouseEvent* event) {
  if (event->button() != drag_.button) return;
  const Drag ended = std::exchange(drag_, {});
  // Centre of the screen pixel under the cursor.
  const double half = 0.5 / devicePixelRatioF();
  const QPointF at = event->position() + QPointF(half, half);
  show_moved({});
  if (ended.button == Qt::RightButton && !ended.moved)
    if (const QString pick = movable_at(event->position()); !pick.isEmpty())
      Q_EMIT pick_menu_wanted(pick, event->globalPosition().toPoint());
  const bool is_click = ended.button == Qt::LeftButton && !ended.moved && raw_at(at);
  if (ended.may_pick && is_click) pick_at(at);
  if (is_click && !takes_clicks()) Q_EMIT not_picked();
  if (!ended.pick.isEmpty() && ended.moved)
    if (const auto raw = raw_at(at)) Q_EMIT pick_moved(ended.pick, *raw);
}

void XrayView::move_click(const QPointF& place) {
  const double half = 0.5 / devicePixelRatioF();  // centre of the screen pixel
  if (const auto raw = raw_at(place + QPointF(half, half)))
    Q_EMIT measure_click_moved(drag_.click->number, drag_.click->click, *raw);
}

HandlePart XrayView::handle_at(const QPointF& place) const {
  return handle_ && handle_in_layer_ ? handle_part(frame_.to_widget(*handle_in_layer_), place)
                                     : HandlePart::none;
}

void XrayView::move_handle(const QPointF& from, const QPointF& to) {
  const auto from_raw = raw_at(from), to_raw = raw_at(to);
  if (from_raw && to_raw)
    Q_EMIT handle_dragged(drag_.handle, *from_raw, *to_raw, std::exchange(drag_.has_moved_handle, true));
}

QString XrayView::movable_at(const QPointF& place) const {
  constexpr double reach = 12;  // screen px
  QString nearest;
  double least = reach;
  for (const FreshPick& pick : movable_)
    if (const auto at = place_of({pick.raw.x(), pick.raw.y()}))
      if (const double distance = std::hypot(at->x() - place.x(), at->y() - place.y()); distance < least) {
        least = distance;
        nearest = pick.name;
      }
  return nearest;
}

void XrayView::show_moved(const std::optional<QPointF>& raw) {
  live_.set_moved(raw ? std::optional(FreshPick{drag_.pick, {raw->x(), raw->y()}}) : std::nullopt);
  carry_live();
}

void XrayView::mouseDoubleClickEvent(QMouseEvent* event) {
  drag_ = {};
  if (event->button() == Qt::LeftButton && !takes_clicks()) fit();
}

void XrayView::enterEvent(QEnterEvent*) { setFocus(Qt::MouseFocusReason); }

void XrayView::leaveEvent(QEvent*) {
  mouse_.reset();
  if (!cursor_) hover_over({});
  update();
}

void XrayView::keyPressEvent(QKeyEvent* event) {
  if (const auto way = way_of(event->key())) {
    if (event->modifiers() & Qt::ShiftModifier)
      return move_cursor((event->modifiers() & Qt::ControlModifier ? 1 : 10) * *way);
    return pan(-40 * *way);
  }
  const QPointF middle = cursor_ ? frame_.to_widget(*cursor_) : QRectF(rect()).center();
  switch (event->key()) {
    case Qt::Key_Plus:
    case Qt::Key_Equal:
      return zoom(key_zoom, middle);
    case Qt::Key_Minus:
      return zoom(1 / key_zoom, middle);
    case Qt::Key_0:
      return fit();
    case Qt::Key_L:
      return set_layer(static_cast<Layer>((static_cast<int>(wanted_) + 1) % 3));
    case Qt::Key_H:
      return set_marks_visible(!marks_visible_);
    case Qt::Key_M:
      return set_magnifier(!magnifier_);
    case Qt::Key_D:
      if (!refusal_) break;
      return set_details_visible(!details_visible_);
    case Qt::Key_W:
      return set_usual_window();
    case Qt::Key_Return:
    case Qt::Key_Enter:
      if (cursor_ && takes_clicks()) return pick_at(frame_.to_widget(*cursor_));
      if (measuring_) return Q_EMIT measure_finished();
      if (cursor_) Q_EMIT not_picked();
      break;
    case Qt::Key_Escape:
      if (!cursor_) break;
      cursor_.reset();
      return hover_over({});
    default:
      break;
  }
  event->ignore();
}

void XrayView::move_cursor(const QPointF& by) {
  if (!shown_) return;
  const QPointF from = cursor_ ? frame_.to_widget(*cursor_) : QRectF(rect()).center();
  const Eigen::Vector2d size(grey_.width() - 1, grey_.height() - 1);
  cursor_ = frame_.to_image(from + by).cwiseMax(0).cwiseMin(size);
  const QPointF at = frame_.to_widget(*cursor_);
  const QRectF sight = QRectF(rect()).adjusted(20, 20, -20, -20);
  if (!sight.contains(at)) pan(sight.center() - at);
  hover_at(frame_.to_widget(*cursor_));
}

void XrayView::pick_at(const QPointF& place) {
  const auto raw = raw_at(place);
  if (!raw) return;
  if (measuring_)
    Q_EMIT measured(*raw);
  else
    Q_EMIT picked(*raw);
}

void XrayView::hover_at(const QPointF& place) {
  constexpr double reach = 14;  // screen px
  if (!shown_) return;
  report::ViewMarks marks = marks_;
  std::erase_if(marks.points, [&](const report::PointMark& mark) { return superseded_.contains(mark.name); });
  hover_over(mark_near(marks, frame_.to_image(place), reach / frame_.scale));
}

void XrayView::hover_over(const std::optional<MarkUnderCursor>& mark) {
  update();
  if (mark == under_) return;
  under_ = mark;
  if (cursor_ && mark) setAccessibleDescription(mark->tip);
  Q_EMIT hovered(mark);
}

}  // namespace helicarm::gui
