// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QByteArray>
#include <QComboBox>
#include <QString>
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

/// A choice of sheets above the curves of the chosen one.
class CurvesPanel : public QWidget {
  Q_OBJECT

 public:
  /// The parts are called `name` + "Sheet" and `name` + "Curves".
  CurvesPanel(const QString& name, const QString& sheet_says, const QString& curves_say);

  QComboBox* sheet() { return sheet_; }
  CurvesView* curves() { return curves_; }

 private:
  QComboBox* sheet_;
  CurvesView* curves_;
};

}  // namespace helicarm::gui
