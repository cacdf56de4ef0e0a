// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QObject>
#include <optional>
#include <string>
#include <vector>

#include "gui/xray/image_measures.h"

namespace helicarm::gui {

/// The measures of all images and the tool that makes them.
class MeasureTool : public QObject {
  Q_OBJECT

 public:
  using QObject::QObject;

  const std::vector<ImageMeasure>& measures() const { return measures_; }
  /// The kind that clicks make; nothing: no tool.
  std::optional<measures::Kind> kind() const { return kind_; }
  /// What the next click is for, and how to go on; empty without a tool.
  QString hint() const;

  void begin(measures::Kind kind);
  /// A click of the tool. Ignored in another image than the first click of an unfinished measure.
  void click(const std::string& image, const Eigen::Vector2d& raw);
  /// Leaves out the optional clicks of the present measure, else ends it.
  void finish();
  /// Removes an unfinished measure and leaves the tool.
  void leave();
  /// Moves a click of a measure, by its index.
  void move(int number, int click, const Eigen::Vector2d& raw);
  void remove(int number);

 signals:
  void changed();

 private:
  ImageMeasure* open();
  void drop_unfinished();

  std::vector<ImageMeasure> measures_;
  std::optional<measures::Kind> kind_;
  bool is_open_ = false;  ///< the last measure takes the next click
  int numbers_ = 0;
};

}  // namespace helicarm::gui
