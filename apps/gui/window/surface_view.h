// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QImage>
#include <QWidget>
#include <memory>
#include <optional>
#include <vector>

#include "helicarm/phantom/mesh.h"

namespace helicarm::gui {

/// What the view of a surface shows; places in the coordinates of the surface, mm.
struct SurfaceScene {
  std::shared_ptr<const phantom::TriangleMesh> mesh;
  std::vector<std::pair<QString, Eigen::Vector3d>> landmarks;
  std::optional<Eigen::Vector3d> cursor;
};

/// A parallel projection. Rows of `turn`: to the right, downwards and away in the window.
struct SurfaceCamera {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< in the window's middle, mm
  double scale = 1;                                  ///< px per mm

  /// Window px from the window's middle, and mm away.
  Eigen::Vector3d project(const Eigen::Vector3d& place) const;
};

/// The surface shaded by its normals, with the distance of each pixel.
struct SurfaceImage {
  QImage pixels;
  std::vector<float> away;  ///< mm, row by row; infinite where there is no surface
};
SurfaceImage draw_surface(const phantom::TriangleMesh& mesh, const SurfaceCamera& camera, QSize size);

/// The place of the surface that lies nearest to the viewer at a window position from the middle.
std::optional<Eigen::Vector3d> surface_at(const phantom::TriangleMesh& mesh, const SurfaceCamera& camera,
                                          const Eigen::Vector2d& at);

/// A surface in three dimensions, drawn without a graphics card. A click places the cursor on it, a drag
/// turns it, the wheel zooms.
class SurfaceView : public QWidget {
  Q_OBJECT

 public:
  explicit SurfaceView(QWidget* parent = nullptr);

  /// From the front of the patient where the mesh is another one.
  void show_scene(const SurfaceScene& scene);
  /// Where a place is drawn.
  QPointF place_of(const Eigen::Vector3d& place) const;
  /// Whether no other part of the surface hides a place on it.
  bool shows(const Eigen::Vector3d& place) const;
  QSize minimumSizeHint() const override { return {140, 140}; }

 signals:
  void placed(const Eigen::Vector3d& place);

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  void look_from_the_front();
  void fit();
  void turn(double right_px, double down_px);
  /// `at`: the window position whose place stays there.
  void zoom(double factor, const QPointF& at);
  void place(const QPointF& at);
  void draw();
  void paint_place(QPainter& painter, const Eigen::Vector3d& place, const QString& name,
                   const QColor& colour);

  SurfaceScene scene_;
  SurfaceCamera camera_;
  SurfaceImage image_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();  ///< of the surface
  double reach_mm_ = 1;                               ///< from there
  double zoom_ = 1;                                   ///< 1: the surface fills the window
  QPointF pressed_, last_;
  bool turns_ = false;
};

}  // namespace helicarm::gui
