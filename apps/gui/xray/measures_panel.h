// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QPushButton>
#include <QTableWidget>

#include "gui/xray/measure_tool.h"

namespace helicarm::gui {

/// The tool's palette, the plane of lengths, and the list of results.
class MeasuresPanel : public QWidget {
  Q_OBJECT

 public:
  explicit MeasuresPanel(MeasureTool& tool, QWidget* parent = nullptr);

  /// Shows the measures in this result; null: none.
  void show_result(std::shared_ptr<const pipeline::Result> result);
  LengthPlane plane() const;
  /// The evaluated measures of the image with this digest.
  std::vector<EvaluatedMeasure> of_image(const std::string& image) const;

 signals:
  /// Measures or plane have changed.
  void changed();

 private:
  QWidget* build_palette();
  QWidget* build_plane();
  void show_points();
  void show_measures();
  std::vector<MeasuredLine> shown_lines() const;
  void copy() const;
  void remove_chosen();
  void remove_shown();

  MeasureTool& tool_;
  std::shared_ptr<const pipeline::Result> result_;
  std::vector<EvaluatedMeasure> evaluated_;
  std::vector<QPushButton*> kinds_;
  QLabel* hint_;
  QComboBox* plane_;
  QDoubleSpinBox* depth_;
  QTableWidget* table_;
  QPushButton *remove_, *clear_, *copy_;
};

}  // namespace helicarm::gui
