// SPDX-License-Identifier: Apache-2.0
#include "gui/window/hold_button.h"

#include <QKeyEvent>
#include <QPainter>

namespace helicarm::gui {
namespace {

constexpr int tick_ms = 16;

bool is_enter(const QKeyEvent* event) {
  return event->key() == Qt::Key_Return || event->key() == Qt::Key_Enter;
}

}  // namespace

HoldButton::HoldButton(const QString& text, QWidget* parent) : QPushButton(text, parent) {
  setProperty("class", "hold");
  setToolTip(tr("Hold the button, or Enter, until it is full"));
  setAccessibleDescription(toolTip());
  connect(&timer_, &QTimer::timeout, this, &HoldButton::tick);
}

void HoldButton::begin() {
  if (!isEnabled() || timer_.isActive()) return;
  since_.start();
  timer_.start(tick_ms);
}

void HoldButton::let_go() {
  timer_.stop();
  setDown(false);
  update();
}

void HoldButton::tick() {
  update();
  if (since_.elapsed() < hold_ms) return;
  let_go();
  emit held();
}

void HoldButton::paintEvent(QPaintEvent* event) {
  QPushButton::paintEvent(event);
  if (!timer_.isActive()) return;
  QPainter painter(this);
  const double share = double(since_.elapsed()) / hold_ms;
  painter.fillRect(QRectF(0, height() - 5, width() * share, 5), QColor(255, 196, 0));
}

void HoldButton::mousePressEvent(QMouseEvent* event) {
  QPushButton::mousePressEvent(event);
  if (isDown()) begin();
}

void HoldButton::mouseMoveEvent(QMouseEvent* event) {
  QPushButton::mouseMoveEvent(event);
  const bool by_pointer = event->buttons() & Qt::LeftButton;
  if (by_pointer && !rect().contains(event->position().toPoint())) let_go();
}

void HoldButton::mouseReleaseEvent(QMouseEvent* event) {
  QPushButton::mouseReleaseEvent(event);
  let_go();
}

void HoldButton::keyPressEvent(QKeyEvent* event) {
  if (!is_enter(event)) return QPushButton::keyPressEvent(event);
  if (!event->isAutoRepeat()) begin();
}

void HoldButton::keyReleaseEvent(QKeyEvent* event) {
  if (!is_enter(event)) return QPushButton::keyReleaseEvent(event);
  if (!event->isAutoRepeat()) let_go();
}

void HoldButton::focusOutEvent(QFocusEvent* event) {
  QPushButton::focusOutEvent(event);
  let_go();
}

void HoldButton::changeEvent(QEvent* event) {
  QPushButton::changeEvent(event);
  if (event->type() == QEvent::EnabledChange && !isEnabled()) let_go();
}

}  // namespace helicarm::gui
