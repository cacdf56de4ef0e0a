// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "gui/scene/model_surface.h"
#include "gui/scene/overlay.h"
#include "gui/scene/scene_camera.h"
#include "gui/scene/scene_values.h"
#include "gui/scene/tre_slice.h"
#include "gui/xray/model_handle.h"
#include "helicarm/simulation/bone_meshes.h"

namespace helicarm::gui {

class OffscreenStage;
struct DrawnModel;
using simulation::BoneMeshes;

/// Calibrator, views, points, bones, tool and robot in 3-D. The left button rotates, the right one and the
/// wheel zoom, the middle one pans; keys: 1 AP, 2 lateral, 3 overview, 4 near, R resets, arrows rotate, + and
/// - zoom.
class SceneView : public QWidget {
  Q_OBJECT

 public:
  enum class Preset { ap, lateral, free };
  Q_ENUM(Preset)

  explicit SceneView(QWidget* parent = nullptr);
  ~SceneView() override;

  /// Why there is no scene; displayed instead of it.
  const std::optional<QString>& obstacle() const;

  /// Null clears the scene. The live part stays.
  void show_result(const std::shared_ptr<const pipeline::Result>& result,
                   const phantom::Calibrator& calibrator, bool keeps_camera = false);
  /// Parts of another world, seen about `middle`.
  void show_scene(ResultScene scene, const Eigen::Vector3d& middle, bool keeps_camera = false);
  /// In amber in the upper left corner; empty: none.
  void set_notice(const QString& notice);
  void show_parts(SceneParts parts);
  SceneParts parts() const { return parts_; }
  void set_opacity(const SceneOpacity& opacity);
  const SceneOpacity& opacity() const { return opacity_; }
  /// Models that are not drawn, by name.
  void hide_models(std::set<std::string> names);
  const std::set<std::string>& hidden_models() const { return hidden_; }
  std::vector<std::string> model_names() const;
  /// In the calibrator's frame, at the acquisition.
  void show_bones(std::optional<BoneMeshes> bones);
  /// The case's models; a surface appears as soon as it is computed.
  void show_models(std::vector<ModelShape> models);
  void show_live(const LiveScene& live);
  /// The slice perpendicular to an axis of the calibrator; empty removes it.
  void show_tre(std::optional<localization::TreVolume> volume, SliceAxis axis, double place_mm);

  /// `ap` and `lateral` take the view of that name (AP, LAT...), else the first and the second view; without
  /// such a view the overview.
  void set_preset(Preset preset);
  Preset preset() const { return preset_; }
  /// Close to the knee, from outside.
  void look_near();
  /// From outside, with the whole robot in sight.
  void look_at_robot();
  /// Of the model that the left button moves.
  struct Handle {
    Eigen::Vector3d place;
    Colour colour;
  };
  void set_handle(const std::optional<Handle>& handle);
  /// Where the handle is drawn; empty without one in sight.
  std::optional<QPointF> handle_place() const;
  /// Largest scale of the drawn 95 % ellipsoids; initially 10. Large ones are enlarged less, or not.
  void set_error_scale(double scale);

  /// Duration of the last rendering up to its image, ms.
  double last_render_ms() const { return last_render_ms_; }
  QSize sizeHint() const override { return {420, 420}; }

 signals:
  /// Other parts, models or opacities are drawn.
  void objects_changed();
  /// The handle is dragged by this shift (mm) or turn (rotation vector about it). `continues`: the drag has
  /// begun before.
  void handle_shifted(const Eigen::Vector3d& by_mm, bool continues);
  void handle_turned(const Eigen::Vector3d& by_rad, bool continues);
  void preset_changed(helicarm::gui::SceneView::Preset preset);

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  double aspect() const { return double(std::max(1, width())) / std::max(1, height()); }
  const ViewShape* view_of(Preset preset) const;
  SceneCamera camera_of(Preset preset) const;
  SceneCamera near_camera() const;
  void move_camera(const SceneCamera& camera);
  void drag_handle(const QPointF& from, const QPointF& to);
  void redraw();
  void draw();
  void paint_overlay(QPainter& painter);
  bool is_drawn(const ModelShape& shape) const;
  std::vector<DrawnModel> drawn_models() const;
  /// The result and the models' plans, of the displayed parts.
  ResultScene drawn_scene() const;
  double drawn_scale() const { return error_scale_of(drawn_scene(), error_scale_); }
  std::vector<SceneLabel> labels() const;

  ResultScene scene_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  ///< of the calibrator's balls, or of the shown scene
  std::optional<BoneMeshes> bones_;
  std::vector<ModelShape> models_;
  ModelSurfaces surfaces_;
  LiveScene live_;
  std::optional<localization::TreVolume> tre_;
  TreScale tre_scale_{0, 1, 0.5};
  SliceAxis slice_axis_ = SliceAxis::z;
  double slice_mm_ = 0;
  double error_scale_ = 10;
  QString notice_;
  SceneParts parts_ = all_parts;
  std::set<std::string> hidden_;
  SceneOpacity opacity_;
  std::optional<Handle> handle_;
  HandlePart dragged_ = HandlePart::none;
  bool has_dragged_ = false;

  Preset preset_ = Preset::free;
  bool moved_ = false;  ///< by the user, away from the preset
  SceneCamera camera_;
  QPointF mouse_;
  std::unique_ptr<OffscreenStage> stage_;
  bool result_changed_ = true, bones_changed_ = true, models_changed_ = true, slice_changed_ = true,
       live_changed_ = true, opacity_changed_ = true;
  QImage drawn_;  ///< null: to be redrawn
  double last_render_ms_ = 0;
};

}  // namespace helicarm::gui
