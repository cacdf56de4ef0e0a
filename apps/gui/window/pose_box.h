// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QDoubleSpinBox>

namespace helicarm::gui {

/// A field of a pose: commands (Ctrl+E, Ctrl+Z, ...) reach the window's menus and never change the number,
/// which the wheel changes only with the focus.
class PoseBox : public QDoubleSpinBox {
  Q_OBJECT

 public:
  explicit PoseBox(QWidget* parent = nullptr);

 protected:
  bool event(QEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
};

}  // namespace helicarm::gui
