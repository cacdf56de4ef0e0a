// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>

#include "gui/controller/controller.h"

namespace helicarm::gui {

/// State of the devices, each with its age in ms, and the tool's position relative to its tunnel.
class LiveBar : public QWidget {
  Q_OBJECT

 public:
  explicit LiveBar(QWidget* parent = nullptr);
  void show_live(const LiveState& live);
  /// The displayed content as text.
  QString words() const;
  /// What the displayed quantities are, with their units.
  static QString definitions();

 protected:
  void paintEvent(QPaintEvent* event) override;
  bool event(QEvent* event) override;
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 private:
  LiveState live_;
};

}  // namespace helicarm::gui
