// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>

#include <vtkActor.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

#include "gui/scene/scene_camera.h"
#include "gui/scene/shape_builder.h"
#include "helicarm/simulation/bone_meshes.h"

namespace helicarm::gui {

using simulation::BoneMeshes;

/// A model's surface in its own coordinates.
struct DrawnModel {
  std::shared_ptr<const phantom::TriangleMesh> surface;  ///< null: not drawn
  Colour colour;
  geometry::RigidTransform calibrator_from_model;
  std::optional<guidance::Bone> moves_with;
  double opacity = SceneOpacity().models;
};

/// The scene in VTK. Lives as long as one OpenGL context, which must be current in every call.
class Stage {
 public:
  Stage();
  ~Stage();

  /// Ellipsoids are drawn enlarged by `error_scale`.
  void set_result(const ResultScene& scene, double error_scale);
  void set_bones(const std::optional<BoneMeshes>& bones);
  void set_slice(const std::optional<TreSlice>& slice, const TreScale& scale);
  /// They stand where `set_live` moves them.
  void set_models(const std::vector<DrawnModel>& models);
  /// Moves existing parts; only a new path is built.
  void set_live(const LiveScene& live);

  /// Of all parts but the models, which bring their own.
  void set_opacity(const SceneOpacity& opacity);

  /// Hides the links of the arm that hide the rest from this camera.
  void clear_sight(const SceneCamera& camera);

  void resize(int width, int height) { window_->SetSize(width, height); }
  /// Renders into the framebuffer of this number, with the image's first row first, as in QImage.
  void render_upside_down(const SceneCamera& camera, unsigned framebuffer);

 private:
  struct ModelActors {
    vtkActor *depth, *surface;  ///< invisible, and drawn where it is the nearest
  };

  bool is_shown(std::size_t link) const;
  vtkActor* add(bool lit);
  /// The actor of a bone, added if it is new.
  vtkActor* of_bone(std::map<guidance::Bone, vtkActor*>& actors, const guidance::Bone& bone);
  ModelActors add_model();
  void make_points_glass();
  void move(vtkActor* actor, const std::optional<geometry::RigidTransform>& calibrator_from_body);

  vtkNew<vtkGenericOpenGLRenderWindow> window_;
  vtkNew<vtkRenderer> renderer_;
  vtkActor *solids_, *lines_, *slice_, *tool_, *path_;
  vtkActor* points_;                                 ///< at rest
  std::map<guidance::Bone, vtkActor*> bone_points_;  ///< that move with a bone
  std::map<guidance::Bone, vtkActor*> markers_;
  std::array<vtkActor*, 7> links_;  ///< the last is the base's foot
  std::map<guidance::Bone, vtkActor*> bones_;
  vtkActor* cone_;
  std::vector<ModelActors> model_actors_;
  std::vector<DrawnModel> models_;  ///< of the first actors
  std::vector<DrawnLink> drawn_links_;
  std::vector<Eigen::Vector3d> shown_path_;
  double points_opacity_ = 1;
  bool has_large_ellipsoids_ = false;
};

}  // namespace helicarm::gui
