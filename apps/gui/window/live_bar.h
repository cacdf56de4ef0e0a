// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>

#include "gui/controller/controller.h"

namespace helicarm::gui {

/// What the devices say now: a lamp each with the age in ms, and how the tool stands to its tunnel.
class LiveBar : public QWidget {
  Q_OBJECT

 public:
  explicit LiveBar(QWidget* parent = nullptr);
  void show_live(const LiveState& live);
  /// What is on the screen, in words.
  QString words() const;

 protected:
  void paintEvent(QPaintEvent* event) override;
  bool event(QEvent* event) override;
  QSize sizeHint() const override { return {1200, 58}; }
  QSize minimumSizeHint() const override { return {600, 58}; }

 private:
  LiveState live_;
};

}  // namespace helicarm::gui
