// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLabel>
#include <QOpenGLWidget>
#include <QSurfaceFormat>
#include <memory>
#include <optional>

#include "gui/scene/overlay.h"
#include "gui/scene/scene_camera.h"
#include "gui/scene/scene_values.h"
#include "gui/scene/tre_slice.h"
#include "helicarm/simulation/bone_meshes.h"

namespace helicarm::gui {

class Stage;
using simulation::BoneMeshes;

/// Calibrator, X-rays, points, bones, tool and robot in space. The left button turns, the right one and the
/// wheel zoom, the middle one shifts; 1 AP, 2 lateral, 3 overview, 4 near, R back, arrows turn, + and - zoom.
class SceneView : public QOpenGLWidget {
  Q_OBJECT

 public:
  enum class Preset { ap, lateral, free };
  Q_ENUM(Preset)

  explicit SceneView(QWidget* parent = nullptr);
  ~SceneView() override;

  /// To be set by QSurfaceFormat::setDefaultFormat before the application starts.
  static QSurfaceFormat default_format();

  /// Why no scene can be drawn here; nothing: it can. To be asked before a view comes into a window, for Qt
  /// 6.4 itself crashes in flushing a window with a QOpenGLWidget on a platform without OpenGL.
  static std::optional<QString> obstacle();

  /// Nothing empties the scene. The live part stays.
  void show_result(std::shared_ptr<const Result> result, const Calibrator& calibrator);
  /// In the calibrator's frame, as they lay at the exposure.
  void show_bones(std::optional<BoneMeshes> bones);
  void show_live(const LiveScene& live);
  /// The slice across an axis of the calibrator; nothing takes it away.
  void show_tre(std::optional<TreVolume> volume, SliceAxis axis, double place_mm);

  /// `ap` and `lateral` look through the view of that name (AP, LAT...), else the first and the second;
  /// without such a view it is the overview.
  void set_preset(Preset preset);
  Preset preset() const { return preset_; }
  /// Near at the knee, from outside.
  void look_near();
  /// How many times larger than true the 95 % ellipsoids are drawn; 10 at first.
  void set_error_scale(double scale);

  /// What the last drawing took, until the graphics were done, ms.
  double last_render_ms() const { return last_render_ms_; }
  QSize sizeHint() const override { return {420, 420}; }

 signals:
  void preset_changed(helicarm::gui::SceneView::Preset preset);
  /// There is no OpenGL here; the reason is shown in place of the scene.
  void unavailable(const QString& reason);

 protected:
  void initializeGL() override;
  void resizeGL(int width, int height) override;
  void paintGL() override;
  void showEvent(QShowEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void changeEvent(QEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  static std::optional<QString> obstacle_of(const QSurfaceFormat& format);
  double aspect() const { return double(std::max(1, width())) / std::max(1, height()); }
  const ViewShape* view_of(Preset preset) const;
  SceneCamera camera_of(Preset preset) const;
  SceneCamera near_camera() const;
  void move_camera(const SceneCamera& camera);
  void tear_down();
  void give_up(const QString& reason);
  void paint_overlay();
  std::vector<SceneLabel> labels() const;

  ResultScene scene_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  ///< of the calibrator's balls
  std::optional<BoneMeshes> bones_;
  LiveScene live_;
  std::optional<TreVolume> tre_;
  TreScale tre_scale_{0, 1, 0.5};
  SliceAxis slice_axis_ = SliceAxis::z;
  double slice_mm_ = 0;
  double error_scale_ = 10;

  Preset preset_ = Preset::free;
  bool moved_ = false;  ///< by hand, away from the preset
  SceneCamera camera_;
  QPointF mouse_;
  std::unique_ptr<Stage> stage_;
  bool result_changed_ = true, bones_changed_ = true, slice_changed_ = true, live_changed_ = true;
  QLabel* notice_;
  bool given_up_ = false;
  double last_render_ms_ = 0;
};

}  // namespace helicarm::gui
