// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_values.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/pipeline/middle.h"
#include "helicarm/simulation/calibrator_body.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Without a pixel size the focal length in mm is unknown; the image is drawn this much farther than the
/// calibrator.
constexpr double beyond_calibrator = 1.5;

double detector_depth(const pipeline::ViewResult& view, const Vector3d& middle) {
  const geometry::View& calibrated = view.calibrated->view;
  std::optional<double> pixel_mm;
  if (view.rectification &&
      view.rectification->map.rectified_plane == rectification::RectifiedPlane::detector)
    pixel_mm = view.rectification->map.rectified_pixel_mm;
  if (!pixel_mm && view.xray_image && view.xray_image->acquisition.pixel_mm)
    pixel_mm = view.xray_image->acquisition.pixel_mm->y();
  return pixel_mm ? calibrated.intrinsics.fy * *pixel_mm : beyond_calibrator * calibrated.depth(middle);
}

Vector3d on_detector(const ViewShape& shape, const Vector2d& pixel) {
  const geometry::Ray ray = geometry::ray_through(shape.view, pixel);
  const Vector3d along = shape.central_ray.to - shape.central_ray.from;
  return ray.origin + ray.direction * (along.squaredNorm() / ray.direction.dot(along));
}

ViewShape shape_of(const pipeline::ViewResult& view, const Vector3d& middle) {
  Vector2d size_px(1024, 1024);
  if (view.xray_image) size_px = {view.xray_image->pixels.width(), view.xray_image->pixels.height()};
  return view_shape(view.name, view.calibrated->view, size_px, detector_depth(view, middle));
}

PointShape shape_of(const pipeline::PointResult& point, const pipeline::Result& result,
                    const std::vector<ViewShape>& views) {
  PointShape shape{point.name, point.source, point.moves_with, {}, {}};
  shape.error = ellipsoid_95(point.place->in_calibrator, point.place->covariance_in_calibrator);
  std::size_t calibrated = 0;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    if (!result.views[i].calibrated) continue;
    const ViewShape& view = views[calibrated++];
    if (i < point.seen.size() && point.seen[i])
      shape.rays.push_back({view.central_ray.from, on_detector(view, point.seen[i]->uv)});
  }
  return shape;
}

}  // namespace

ViewShape view_shape(const std::string& name, const geometry::View& view, const Vector2d& size_px,
                     double depth_mm) {
  ViewShape shape{name, view, size_px, {}, {}};
  const Vector3d source = view.source_in_world();
  const Vector3d beam = view.camera_from_world.rotation.row(2).transpose();
  shape.central_ray = {source, source + depth_mm * beam};
  const Vector2d last = shape.size_px.array() - 0.5;
  const std::array<Vector2d, 4> corners{
      {{-0.5, -0.5}, {last.x(), -0.5}, {last.x(), last.y()}, {-0.5, last.y()}}};
  for (std::size_t i = 0; i < 4; ++i) shape.detector[i] = on_detector(shape, corners[i]);
  return shape;
}

Ellipsoid ellipsoid_95(const Vector3d& centre, const Eigen::Matrix3d& covariance) {
  if (!covariance.allFinite()) return {centre, Eigen::Matrix3d::Identity(), Vector3d::Zero()};
  const auto [values, vectors] = geometry::symmetric_eigen(covariance);
  Eigen::Matrix3d axes = vectors;
  if (axes.determinant() < 0) axes.col(0) *= -1;
  return {centre, axes, (chi2_95 * values.cwiseMax(0)).cwiseSqrt()};
}

std::optional<phantom::TriangleMesh> cone_of(const phantom::Calibrator& calibrator) {
  constexpr unsigned sides = 48;
  constexpr double off_wall_mm = 5;
  const simulation::ConeWall wall = simulation::cone_wall(calibrator);
  if (!(wall.radius_at(wall.bottom_mm) > 0 && wall.radius_at(wall.top_mm) > 0)) return {};
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    const Vector3d& at = ball.centre_in_calibrator;
    if (std::abs(at.head<2>().norm() - wall.radius_at(at.z())) > off_wall_mm) return {};
  }
  phantom::TriangleMesh mesh;
  for (unsigned i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    for (const double z : {wall.bottom_mm, wall.top_mm})
      mesh.corners.push_back({wall.radius_at(z) * std::cos(angle), wall.radius_at(z) * std::sin(angle), z});
    const unsigned low = 2 * i, high = low + 1, next = 2 * ((i + 1) % sides);
    mesh.triangles.push_back({low, next, high});
    mesh.triangles.push_back({high, next, next + 1});
  }
  return mesh;
}

ResultScene scene_of(const pipeline::Result& result, const phantom::Calibrator& calibrator) {
  ResultScene scene{calibrator.balls, cone_of(calibrator), {}, {}, {}};
  const Vector3d middle = pipeline::middle_of(calibrator, result.views);
  for (const pipeline::ViewResult& view : result.views)
    if (view.calibrated) scene.views.push_back(shape_of(view, middle));
  for (const pipeline::PointResult& point : result.points)
    if (point.place) scene.points.push_back(shape_of(point, result, scene.views));
  for (std::size_t i = 0; i < result.tunnel_ends.size(); ++i) {
    const pipeline::PointResult& start = result.points[result.tunnel_ends[i].start];
    const pipeline::PointResult& end = result.points[result.tunnel_ends[i].end];
    if (start.place && end.place)
      scene.tunnels.push_back({i < result.tunnels.size() ? result.tunnels[i].name : std::string(),
                               start.moves_with,
                               {start.place->in_calibrator, end.place->in_calibrator}});
  }
  return scene;
}

std::optional<ModelShape> shape_of(const case_registration::RegisteredModel& model,
                                   const std::optional<geometry::RigidTransform>& by_hand,
                                   const Colour& colour) {
  const registration::Registration& found = model.registration;
  const bool has_pose = by_hand || found.is_determined();
  if (!has_pose || (!model.model && found.failure)) return std::nullopt;
  ModelShape shape;
  shape.name = found.name;
  shape.state = by_hand         ? ModelShape::State::by_hand
                : found.failure ? ModelShape::State::refused
                                : ModelShape::State::registered;
  shape.colour = colour;
  shape.model = model.model;
  shape.calibrator_from_model = by_hand.value_or(found.world_from_model);
  shape.moves_with = model.moves_with;
  if (shape.state != ModelShape::State::registered) return shape;
  for (const case_registration::RegisteredPoint& point : model.points)
    shape.points.push_back({point.name,
                            localization::PointSource::pick,
                            model.moves_with,
                            ellipsoid_95(point.place.in_calibrator, point.place.covariance_in_calibrator),
                            {}});
  for (std::size_t i = 0; i < model.tunnels.size(); ++i)
    shape.tunnels.push_back({model.tunnels[i].name,
                             model.moves_with,
                             {shape.points[model.tunnel_ends[i].start].error.centre,
                              shape.points[model.tunnel_ends[i].end].error.centre}});
  for (std::size_t i = 0; i < std::min(model.tunnels.size(), model.bone_checks.size()); ++i)
    if (const auto& check = model.bone_checks[i]) {
      TunnelShape& tunnel = shape.tunnels[i];
      if (check->diameter_mm) tunnel.radius_mm = 0.5 * *check->diameter_mm;
      tunnel.is_breach = check->is_breach();
      tunnel.is_thin = check->is_thin();
    }
  return shape;
}

ResultScene only(SceneParts parts, ResultScene scene) {
  if (!(parts & ScenePart::calibrator)) {
    scene.balls.clear();
    scene.body.reset();
  }
  if (!(parts & ScenePart::rays)) {
    scene.views.clear();
    for (PointShape& point : scene.points) point.rays.clear();
  }
  if (!(parts & ScenePart::points)) {
    scene.points.clear();
    scene.tunnels.clear();
  }
  return scene;
}

double error_scale_of(const ResultScene& scene, double largest) {
  constexpr double most_mm = 20;
  double radius = 0;
  for (const PointShape& point : scene.points) radius = std::max(radius, point.error.radii.maxCoeff());
  for (const double scale : {10.0, 5.0, 2.0})
    if (scale <= largest && scale * radius <= most_mm) return scale;
  return largest * radius <= most_mm ? largest : 1;
}

ResultScene with_plans(ResultScene scene, const std::vector<ModelShape>& models) {
  for (const ModelShape& model : models) {
    scene.points.insert(scene.points.end(), model.points.begin(), model.points.end());
    scene.tunnels.insert(scene.tunnels.end(), model.tunnels.begin(), model.tunnels.end());
  }
  return scene;
}

std::vector<DrawnLink> drawn_links(const LiveScene& live) {
  constexpr std::size_t thick = 3;  // links from the base on
  constexpr double foot_radius_mm = 60, thick_mm = 38, thin_mm = 26, joint = 1.15;
  std::vector<DrawnLink> links;
  for (const Segment& axis : robot_links(live)) {
    const double radius = links.size() < thick ? thick_mm : thin_mm;
    links.push_back({axis, radius, joint * radius});
  }
  if (links.empty()) return links;
  const Vector3d up = live.calibrator_from_base->rotation.col(2), base = links.front().axis.from;
  links.push_back({{base - 30 * up, base + 20 * up}, foot_radius_mm, 1});
  return links;
}

std::optional<MovedBone> moved_bone(const ResultScene& scene, const guidance::Bone& bone,
                                    const geometry::RigidTransform& motion) {
  constexpr double least_mm = 0.5;
  Vector3d sum = Vector3d::Zero();
  int points = 0;
  for (const PointShape& point : scene.points)
    if (point.moves_with == bone) sum += point.error.centre, ++points;
  if (points == 0) return std::nullopt;
  const Vector3d middle = sum / points, now = motion * middle;
  const double moved_mm = (now - middle).norm();
  return moved_mm < least_mm ? std::nullopt : std::optional(MovedBone{now, moved_mm});
}

std::vector<Segment> robot_links(const LiveScene& live) {
  const auto model = robot::robot_model(live.robot_model);
  if (!live.calibrator_from_base || !live.joints || !model) return {};
  std::vector<Segment> links;
  Vector3d from = live.calibrator_from_base->translation;
  for (const geometry::RigidTransform& base_from_frame : robot::joint_frames(*model, *live.joints)) {
    const Vector3d to = *live.calibrator_from_base * base_from_frame.translation;
    links.push_back({from, to});
    from = to;
  }
  return links;
}

}  // namespace helicarm::gui
