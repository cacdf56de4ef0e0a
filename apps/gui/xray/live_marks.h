// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <utility>

#include "gui/xray/image_frame.h"
#include "gui/xray/marks.h"
#include "helicarm/guidance/image_line.h"

namespace helicarm::gui {

/// A picked point that is not in a result yet, raw px.
struct FreshPick {
  QString name;
  Eigen::Vector2d raw;
  QString why_failed = {};  ///< not empty: it is no pick
};

/// A line of a model's plan. `warns`: the colour of a wall that leaves the bone, or comes near its surface.
struct OutlinedTunnel {
  rectification::PixelPath path;
  std::optional<QColor> warns = {};
};

/// A registered model: dots along its outline, points and tunnels of its plan, rectified px.
struct ModelOutline {
  std::vector<Eigen::Vector2d> dots;
  std::vector<std::pair<QString, Eigen::Vector2d>> points;
  std::vector<OutlinedTunnel> tunnels = {};
};

/// Changing marks over the image: as given (picks raw, the rest rectified) and in the layer's pixels.
class LiveMarks {
 public:
  /// One line for each other view with the pick.
  void set_epipolar(std::vector<rectification::PixelPath> rectified);
  void set_path(rectification::PixelPath rectified) { path_ = {std::move(rectified)}; }
  bool has_tool() const { return !tool_.given.empty(); }
  void set_tool(const std::optional<guidance::ImageLine>& rectified, const QString& note);
  void set_picks(std::vector<FreshPick> raw);
  void set_outlines(std::vector<ModelOutline> rectified);
  /// The pick that is being dragged, in place of the one of its name.
  void set_moved(std::optional<FreshPick> raw);

  /// Changes the layer; converted positions become invalid.
  void forget_layer();
  /// Converts the remaining positions to the layer; call it after a change.
  void carry(const pipeline::ViewResult& view, Layer layer);
  void paint(QPainter& painter, const ImageFrame& frame, const QRectF& bounds) const;

 private:
  struct Carried {
    rectification::PixelPath given;
    bool is_carried = false;
    std::vector<rectification::PixelPath> in_layer = {};
    std::optional<Eigen::Vector2d> end = {};
  };
  struct CarriedPick {
    FreshPick given;
    std::optional<Eigen::Vector2d> in_layer;
  };
  struct CarriedOutline {
    ModelOutline given, in_layer = {};
    bool is_carried = false;
  };
  std::vector<Carried> epipolar_;
  Carried path_, tool_;
  QString note_;
  std::vector<CarriedOutline> outlines_;
  std::vector<CarriedPick> picks_;
  std::optional<CarriedPick> moved_;
};

}  // namespace helicarm::gui
