// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QElapsedTimer>
#include <QPushButton>
#include <QTimer>

namespace helicarm::gui {

/// Prevents accidental clicks on robot motion: the button (or Enter) must be held until it is full.
/// A pointer that leaves it lets it go.
class HoldButton : public QPushButton {
  Q_OBJECT

 public:
  static constexpr int hold_ms = 1200;

  explicit HoldButton(const QString& text, QWidget* parent = nullptr);
  /// By mouse or key, and not yet full.
  bool is_held() const { return timer_.isActive(); }

 signals:
  void held();

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;
  void keyReleaseEvent(QKeyEvent* event) override;
  void focusOutEvent(QFocusEvent* event) override;
  void changeEvent(QEvent* event) override;

 private:
  void begin();
  void let_go();
  void tick();

  QTimer timer_;
  QElapsedTimer since_;
};

}  // namespace helicarm::gui
