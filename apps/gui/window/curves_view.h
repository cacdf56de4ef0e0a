// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QByteArray>
#include <QWidget>

namespace helicarm::gui {

/// The curves of a sheet of the report, on white.
class CurvesView : public QWidget {
  Q_OBJECT

 public:
  using QWidget::QWidget;
  /// An SVG document.
  void show_svg(QByteArray svg);
  const QByteArray& svg() const { return svg_; }

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  QByteArray svg_;
};

}  // namespace helicarm::gui
