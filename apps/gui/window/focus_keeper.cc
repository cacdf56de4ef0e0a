// SPDX-License-Identifier: Apache-2.0
#include "gui/window/focus_keeper.h"

#include <QAbstractButton>
#include <QApplication>

namespace helicarm::gui {
namespace {

bool takes_focus(const QWidget* widget) {
  return widget->isEnabled() && widget->isVisible() && (widget->focusPolicy() & Qt::TabFocus);
}

}  // namespace

FocusKeeper::FocusKeeper(QWidget* window) : QObject(window), window_(window) {
  connect(qApp, &QApplication::focusChanged, this, [this](QWidget* old, QWidget*) {
    if (old == nullptr || old->window() != window_) return;
    const bool was_taken = !old->isEnabled() || !old->isVisible();
    if (was_taken && !lost_)
      lost_ = old;
    else if (!was_taken)
      lost_.clear();
  });
}

void FocusKeeper::restore(QWidget* page) {
  if (!lost_) return;
  QWidget* lost = lost_;
  if (takes_focus(lost)) {
    lost->setFocus();
    return lost_.clear();
  }
  if (lost->isVisible()) return;  // disabled still
  for (auto* control : page->findChildren<QAbstractButton*>())
    if (takes_focus(control)) {
      control->setFocus();
      return lost_.clear();
    }
}

}  // namespace helicarm::gui
