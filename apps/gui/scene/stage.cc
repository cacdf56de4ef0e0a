// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/stage.h"

#include <algorithm>
#include <cmath>

#include <vtkCamera.h>
#include <vtkCommand.h>
#include <vtkMatrix4x4.h>
#include <vtkOpenGLFramebufferObject.h>
#include <vtkOpenGLState.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtk_glew.h>

#include "gui/scene/palette.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector3d;

/// A larger ellipsoid does not hide what it contains.
constexpr double opaque_mm = 15, large_ellipsoid_opacity = 0.3;

void give(vtkActor* actor, const ShapeBuilder& shapes) {
  vtkPolyDataMapper::SafeDownCast(actor->GetMapper())->SetInputData(shapes.build());
  actor->SetVisibility(shapes.build()->GetNumberOfCells() > 0);
}

/// Blended over the previous content, front faces only: no sorting, no second pass.
void make_glass(vtkActor* actor, double opacity) {
  actor->GetProperty()->SetOpacity(opacity);
  actor->ForceOpaqueOn();
}

void add_triad(ShapeBuilder& shapes, double length_mm) {
  for (int axis = 0; axis < 3; ++axis)
    shapes.add_tube({Vector3d::Zero(), length_mm * Vector3d::Unit(axis)}, 1, 1,
                    palette::axes[std::size_t(axis)]);
}

/// Maps the unit tube along z onto a link.
geometry::RigidTransform along(const Segment& link) {
  const Vector3d way = link.to - link.from;
  return {geometry::rotation_between(Vector3d::UnitZ(), way), link.from};
}

}  // namespace

Stage::Stage() {
  window_->SetOwnContext(0);
  window_->SetIsCurrent(true);  // required by Stage
  window_->SetSupportsOpenGL(1);
  window_->SetIsDirect(1);
  window_->SetMultiSamples(0);
  window_->SetFrameBlitModeToNoBlit();
  window_->SetReadyForRendering(true);
  window_->OpenGLInit();
  window_->AddRenderer(renderer_);
  renderer_->SetBackground(palette::background[0] / 255.0, palette::background[1] / 255.0,
                           palette::background[2] / 255.0);
  renderer_->SetAutomaticLightCreation(true);

  solids_ = add(true);
  lines_ = add(false);
  path_ = add(false);
  points_ = add(true);
  tool_ = add(true);
  for (vtkActor*& link : links_) link = add(true);
  slice_ = add(false);
  for (const guidance::Bone& bone : guidance::knee_bones())
    make_glass(of_bone(bones_, bone), SceneOpacity().bones);
  make_glass(cone_ = add(true), SceneOpacity().calibrator);

  ShapeBuilder tool;
  tool.add_tube({{0, 0, -150}, {0, 0, -30}}, 9, 9, palette::tool_grip);
  tool.add_tube({{0, 0, -30}, {0, 0, -8}}, 2.5, 2.5, palette::tool);
  tool.add_tube({{0, 0, -8}, {0, 0, 0}}, 2.5, 0.2, palette::tool);
  give(tool_, tool);
  move(tool_, {});
  for (vtkActor* link : links_) move(link, {});
}

Stage::~Stage() {
  window_->Finalize();
  window_->SetReadyForRendering(false);
}

vtkActor* Stage::add(bool lit) {
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetColorModeToDirectScalars();
  mapper->SetInputData(ShapeBuilder().build());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetLighting(lit);
  actor->GetProperty()->SetBackfaceCulling(
      lit);  // transparent from inside: the camera may be in a source's sphere
  actor->GetProperty()->SetAmbient(lit ? 0.25 : 1);
  actor->GetProperty()->SetDiffuse(lit ? 0.8 : 0);
  actor->SetVisibility(false);
  renderer_->AddActor(actor);
  return actor;
}

vtkActor* Stage::of_bone(std::map<guidance::Bone, vtkActor*>& actors, const guidance::Bone& bone) {
  const auto [actor, is_new] = actors.try_emplace(bone);
  if (is_new) actor->second = add(true);
  return actor->second;
}

void Stage::move(vtkActor* actor, const std::optional<geometry::RigidTransform>& calibrator_from_body) {
  actor->SetVisibility(calibrator_from_body.has_value());
  if (!calibrator_from_body) return;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = calibrator_from_body->matrix();
  vtkNew<vtkMatrix4x4> matrix;
  matrix->DeepCopy(rows.data());
  actor->SetUserMatrix(matrix);
}

void Stage::set_result(const ResultScene& scene, double error_scale) {
  ShapeBuilder solids, lines, cone;
  for (const phantom::CalibratorBall& ball : scene.balls)
    solids.add_ball(ball.centre_in_calibrator, ball.diameter_mm / 2, palette::steel);
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    const ViewShape& view = scene.views[i];
    solids.add_ball(view.central_ray.from, 12, palette::of_view(i));
    lines.add_line(view.detector, palette::of_view(i), true);
    const Vector3d ray[]{view.central_ray.from, view.central_ray.to};
    lines.add_line(ray, palette::dim(palette::of_view(i)));
  }
  ShapeBuilder points;
  double largest_mm = 0;  // of the ellipsoids as drawn
  std::map<guidance::Bone, ShapeBuilder> bone_points;
  for (const auto& [bone, actor] : bone_points_) bone_points[bone];  // emptied if it has none now
  const auto group = [&](const std::optional<guidance::Bone>& bone) -> ShapeBuilder& {
    return bone ? bone_points[*bone] : points;
  };
  for (const PointShape& point : scene.points) {
    for (const Segment& ray : point.rays) {
      const Vector3d ends[]{ray.from, ray.to};
      lines.add_line(ends, palette::ray);
    }
    Ellipsoid drawn = point.error;
    drawn.radii *= error_scale;
    largest_mm = std::max(largest_mm, drawn.radii.maxCoeff());
    group(point.moves_with).add_ellipsoid(drawn, palette::point);
  }
  for (const TunnelShape& tunnel : scene.tunnels)
    group(tunnel.moves_with)
        .add_tube(tunnel.axis, tunnel.radius_mm, tunnel.radius_mm,
                  tunnel.is_breach ? palette::breach
                  : tunnel.is_thin ? palette::thin
                                   : palette::tunnel);
  if (scene.body) {
    cone.add_mesh(*scene.body, palette::plastic);
    std::array<std::vector<Vector3d>, 2> rims;  // in the order of cone_of: base and top alternate
    for (std::size_t i = 0; i < scene.body->corners.size(); ++i)
      rims[i % 2].push_back(scene.body->corners[i]);
    for (const auto& rim : rims) lines.add_line(rim, palette::dim(palette::plastic), true);
  }
  give(solids_, solids);
  give(lines_, lines);
  give(cone_, cone);
  give(points_, points);
  for (const auto& [bone, shapes] : bone_points) give(of_bone(bone_points_, bone), shapes);
  has_large_ellipsoids_ = largest_mm > opaque_mm;
  make_points_glass();
}

void Stage::make_points_glass() {
  const double opacity =
      has_large_ellipsoids_ ? std::min(large_ellipsoid_opacity, points_opacity_) : points_opacity_;
  make_glass(points_, opacity);
  for (const auto& [bone, actor] : bone_points_) make_glass(actor, opacity);
}

void Stage::set_opacity(const SceneOpacity& opacity) {
  make_glass(cone_, opacity.calibrator);
  for (const auto& [bone, actor] : bones_) make_glass(actor, opacity.bones);
  for (vtkActor* link : links_) make_glass(link, opacity.robot);
  make_glass(tool_, opacity.robot);
  points_opacity_ = opacity.points;
  make_points_glass();
}

void Stage::set_bones(const std::optional<BoneMeshes>& bones) {
  for (const auto& [name, actor] : bones_) {
    ShapeBuilder bone;
    if (bones) bone.add_mesh(name == "femur" ? bones->femur : bones->tibia, palette::bone);
    give(actor, bone);
  }
}

void Stage::set_slice(const std::optional<TreSlice>& slice, const TreScale& scale) {
  ShapeBuilder shapes;
  if (slice) shapes.add_slice(*slice, scale);
  give(slice_, shapes);
}

Stage::ModelActors Stage::add_model() {
  const ModelActors made{add(true), add(true)};
  make_glass(made.depth, 0.001);  // rounds to nothing, but writes its depth: folds behind are not blended
  make_glass(made.surface, SceneOpacity().models);
  made.depth->SetMapper(made.surface->GetMapper());
  made.surface->GetMapper()->ScalarVisibilityOff();
  const vtkSmartPointer<vtkActor> last = cone_;  // glass hides what is drawn after it
  renderer_->RemoveActor(last);
  renderer_->AddActor(last);
  return made;
}

void Stage::set_models(const std::vector<DrawnModel>& models) {
  while (model_actors_.size() < models.size()) model_actors_.push_back(add_model());
  for (std::size_t i = 0; i < model_actors_.size(); ++i) {
    const auto& [depth, actor] = model_actors_[i];
    const auto surface = i < models.size() ? models[i].surface : nullptr;
    if (surface != (i < models_.size() ? models_[i].surface : nullptr)) {
      ShapeBuilder shape;
      if (surface) shape.add_mesh(*surface, {});
      give(actor, shape);
      depth->SetVisibility(actor->GetVisibility());
    }
    if (i >= models.size()) continue;
    const auto& [red, green, blue] = models[i].colour;
    actor->GetProperty()->SetOpacity(models[i].opacity);
    actor->GetProperty()->SetColor(red / 255.0, green / 255.0, blue / 255.0);
  }
  models_ = models;
}

void Stage::set_live(const LiveScene& live) {
  const auto motion_of = [&](const guidance::Bone& bone) {
    const auto motion = live.bones_moved.find(bone);
    return motion == live.bones_moved.end() ? geometry::RigidTransform() : motion->second;
  };
  const auto filled = [](vtkActor* actor) {
    return vtkPolyDataMapper::SafeDownCast(actor->GetMapper())->GetInput()->GetNumberOfCells() > 0;
  };
  for (const auto* actors : {&bones_, &bone_points_})
    for (const auto& [bone, actor] : *actors) {
      move(actor, motion_of(bone));
      actor->SetVisibility(filled(actor));
    }
  for (const auto& [bone, marker] : markers_) move(marker, {});
  for (const auto& [bone, calibrator_from_marker] : live.calibrator_from_bone_marker) {
    vtkActor* marker = of_bone(markers_, bone);
    if (!filled(marker)) {
      ShapeBuilder triad;
      add_triad(triad, 25);
      give(marker, triad);
    }
    move(marker, calibrator_from_marker);
  }
  move(tool_, live.calibrator_from_tip);
  for (std::size_t i = 0; i < models_.size(); ++i) {
    const auto& [surface, colour, calibrator_from_model, moves_with, opacity] = models_[i];
    const geometry::RigidTransform moved = moves_with ? motion_of(*moves_with) : geometry::RigidTransform();
    for (vtkActor* actor : {model_actors_[i].depth, model_actors_[i].surface})
      move(actor, surface ? std::optional(moved * calibrator_from_model) : std::nullopt);
  }

  drawn_links_ = drawn_links(live);
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const bool shown = is_shown(i);
    if (shown && !filled(links_[i])) {  // the link lengths are constant
      const auto& [axis, radius, joint_radius] = drawn_links_[i];
      const double length = (axis.to - axis.from).norm();
      ShapeBuilder link;
      link.add_tube({Vector3d::Zero(), length * Vector3d::UnitZ()}, radius, radius, palette::robot);
      link.add_ball(length * Vector3d::UnitZ(), joint_radius, palette::joint);
      give(links_[i], link);
    }
    move(links_[i], shown ? std::optional(along(drawn_links_[i].axis)) : std::nullopt);
  }
  if (live.path == shown_path_) return;
  ShapeBuilder path;
  path.add_line(live.path, palette::path);
  give(path_, path);
  shown_path_ = live.path;
}

bool Stage::is_shown(std::size_t link) const {
  constexpr double shortest_mm = 1;
  return link < drawn_links_.size() &&
         (drawn_links_[link].axis.to - drawn_links_[link].axis.from).norm() > shortest_mm;
}

void Stage::clear_sight(const SceneCamera& camera) {
  for (std::size_t i = 0; i < links_.size(); ++i)
    links_[i]->SetVisibility(is_shown(i) && !obstructs(camera, drawn_links_[i]));
}

void Stage::render_upside_down(const SceneCamera& camera, unsigned framebuffer) {
  vtkCamera* vtk = renderer_->GetActiveCamera();
  vtk->SetPosition(camera.position.data());
  vtk->SetFocalPoint(camera.focal_point.data());
  vtk->SetViewUp(camera.up.data());
  vtk->SetViewAngle(camera.height_deg);
  renderer_->ResetCameraClippingRange();
  vtkOpenGLState* state = window_->GetState();
  state->Reset();  // Qt has changed the OpenGL state
  state->Push();
  state->vtkglDepthFunc(GL_LEQUAL);
  window_->Render();
  state->Pop();
  const int* size = window_->GetSize();
  state->vtkglBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer);
  state->vtkglViewport(0, 0, size[0], size[1]);
  state->vtkglScissor(0, 0, size[0], size[1]);
  window_->BlitDisplayFramebuffer(0, 0, 0, size[0], size[1], 0, size[1], size[0], -size[1],
                                  GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

}  // namespace helicarm::gui
