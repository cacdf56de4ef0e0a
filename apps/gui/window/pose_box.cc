// SPDX-License-Identifier: Apache-2.0
#include "gui/window/pose_box.h"

#include <QKeyEvent>

namespace helicarm::gui {
namespace {

/// Of the window, not of the text in the field.
bool is_command(const QKeyEvent& pressed) {
  const bool edits = pressed.matches(QKeySequence::Copy) || pressed.matches(QKeySequence::Paste) ||
                     pressed.matches(QKeySequence::Cut) || pressed.matches(QKeySequence::SelectAll);
  return (pressed.modifiers() & (Qt::ControlModifier | Qt::AltModifier | Qt::MetaModifier)) && !edits;
}

}  // namespace

PoseBox::PoseBox(QWidget* parent) : QDoubleSpinBox(parent) { setFocusPolicy(Qt::StrongFocus); }

bool PoseBox::event(QEvent* event) {
  if (event->type() == QEvent::ShortcutOverride && is_command(*static_cast<QKeyEvent*>(event))) {
    event->ignore();
    return true;
  }
  return QDoubleSpinBox::event(event);
}

void PoseBox::keyPressEvent(QKeyEvent* event) {
  if (is_command(*event)) return event->ignore();
  QDoubleSpinBox::keyPressEvent(event);
}

void PoseBox::wheelEvent(QWheelEvent* event) {
  if (!hasFocus()) return event->ignore();
  QDoubleSpinBox::wheelEvent(event);
}

}  // namespace helicarm::gui
