// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <optional>
#include <vector>

#include "gui/xray/image_frame.h"
#include "gui/xray/image_measures.h"
#include "gui/xray/layers.h"
#include "helicarm/rectification/raw_path.h"

namespace helicarm::gui {

/// A click of a measure, by the measure's number and the click's index.
struct ClickMark {
  int number;
  int click;
  Eigen::Vector2d place;  ///< in the layer
};

/// Measures drawn over an image, in the pixels of its layer.
class MeasureMarks {
 public:
  void set(std::vector<EvaluatedMeasure> measures) { given_ = std::move(measures); }
  /// Converts to the layer; call it after a change of either.
  void carry(const pipeline::ViewResult& view, Layer layer);
  void paint(QPainter& painter, const ImageFrame& frame) const;
  /// The nearest click within `reach` screen px.
  std::optional<ClickMark> click_near(const QPointF& place, double reach, const ImageFrame& frame) const;

 private:
  struct Line {
    rectification::PixelPath path;
    bool is_fine;
  };
  struct Words {
    Eigen::Vector2d at;
    QString text;
  };
  std::vector<EvaluatedMeasure> given_;
  std::vector<Line> lines_;
  std::vector<ClickMark> clicks_;
  std::vector<Words> words_;
};

}  // namespace helicarm::gui
