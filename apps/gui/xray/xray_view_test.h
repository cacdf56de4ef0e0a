// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QApplication>
#include <QTest>

#include <gtest/gtest.h>

#include "gui/xray/simulated_result_test.h"
#include "gui/xray/xray_view.h"

namespace helicarm::gui {

/// A view of the simulated result, and the mouse and keys over it.
class XrayViewTest : public testing::Test {
 protected:
  void SetUp() override {
    view.resize(640, 640);
    view.show();
    view.show_view(simulated_result(), 0);
    settle();
  }
  void settle() {
    for (int i = 0; i < 500 && view.is_computing(); ++i) QTest::qWait(10);
    ASSERT_FALSE(view.is_computing());
  }
  const pipeline::ViewResult& shown() { return simulated_result()->views[0]; }
  void key(int which, Qt::KeyboardModifiers with = Qt::NoModifier) {
    QTest::keyClick(&view, static_cast<Qt::Key>(which), with);
  }
  void drag(const QPoint& from, const QPoint& to, Qt::MouseButton button) {
    QTest::mousePress(&view, button, {}, from);
    for (const QPoint& at : {from + (to - from) / 2, to}) {
      QMouseEvent move(QEvent::MouseMove, at, view.mapToGlobal(QPointF(at)), Qt::NoButton, button, {});
      QApplication::sendEvent(&view, &move);
    }
    QTest::mouseRelease(&view, button, {}, to);
  }
  void wheel(const QPoint& at, int angle) {
    QWheelEvent event(at, view.mapToGlobal(QPointF(at)), {}, {0, angle}, {}, {}, Qt::NoScrollPhase, false);
    QApplication::sendEvent(&view, &event);
  }

  XrayView view;
};

}  // namespace helicarm::gui
