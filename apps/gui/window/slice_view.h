// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLineF>
#include <QWidget>
#include <memory>
#include <optional>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm::gui {

/// A planned tunnel in the CT's patient frame, mm.
struct CtTunnel {
  std::string name;
  Eigen::Vector3d start, end;
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> approach = {};  ///< on its axis, to the bone
};

/// What is planned in a CT.
struct CtPlan {
  std::vector<CtTunnel> tunnels;
  std::vector<Eigen::Vector3d> path = {};  ///< of the tool's tip, patient frame, mm
};

/// Voxels of a CT that are of a body.
struct CtBody {
  std::shared_ptr<const std::vector<std::uint8_t>> voxels;  ///< not 0; null: none are known
  QString says;                                             ///< what of the body they are, for the legend
};

/// What slices of a CT show; places are voxels.
struct CtScene {
  std::shared_ptr<const volume::Volume> ct;
  std::shared_ptr<const std::vector<std::uint8_t>> labels;  ///< of the bones; null: none found yet
  CtBody body = {};                                         ///< outlined
  std::vector<std::pair<QString, Eigen::Vector3d>> seeds;
  CtPlan plan;
  Eigen::Vector3d cursor = Eigen::Vector3d::Zero();
  double low_hu = -200, high_hu = 1200;
};

/// The grey values of a slice through the cursor across a voxel axis, with the bones' colours.
QImage slice_image(const CtScene& scene, int axis);

/// Edges between voxels of the body and others in that image, px; its first pixel ends at (1, 1).
std::vector<QLineF> body_outline(const CtScene& scene, int axis);

/// A slice of a CT across one of its axes. A click moves the cursor, the wheel the slice.
class SliceView : public QWidget {
  Q_OBJECT

 public:
  explicit SliceView(int axis, QWidget* parent = nullptr);

  void show_scene(const CtScene& scene);
  /// Where a voxel is drawn.
  QPointF place_of(const Eigen::Vector3d& voxel) const;
  QSize minimumSizeHint() const override { return {140, 140}; }

 signals:
  void placed(const Eigen::Vector3d& voxel);

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  struct Frame {
    QPointF origin;
    double across, down;  ///< screen px per voxel
  };
  Frame frame() const;
  void paint_body(QPainter& painter) const;
  void place(const QPointF& at);
  void move_slice(double by);

  int axis_;
  CtScene scene_;
  QImage drawn_;
  std::vector<QLineF> outline_;
};

}  // namespace helicarm::gui
