// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace helicarm::gui {
namespace {

using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180;
constexpr double margin = 1.06;  // around the content of the window
constexpr double overview_height_deg = 28;

double half_height(const SceneCamera& camera) { return std::tan(camera.height_deg * degree / 2); }

}  // namespace

SceneCamera camera_through(const ViewShape& view, const Vector3d& middle, double aspect) {
  const Eigen::Matrix3d& rotation = view.view.camera_from_world.rotation;
  const geometry::Intrinsics& k = view.view.intrinsics;
  const auto farthest = [](double centre, double size) {
    return std::max(centre + 0.5, size - 0.5 - centre);
  };
  const double half = margin * std::max(farthest(k.v0, view.size_px.y()) / std::abs(k.fy),
                                        farthest(k.u0, view.size_px.x()) / std::abs(k.fx) / aspect);
  const Vector3d source = view.central_ray.from;
  return {source, source + view.view.depth(middle) * rotation.row(2).transpose(),
          -rotation.row(1).transpose(), 2 * std::atan(half) / degree};
}

SceneCamera overview_of(std::span<const Vector3d> places, double aspect) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& place : places) box.extend(place);
  const Vector3d middle = places.empty() ? Vector3d::Zero() : Vector3d(box.center());
  const Vector3d forward = Vector3d(-0.85, 0.42, -0.36).normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
  SceneCamera camera{middle, middle + forward, right.cross(forward), overview_height_deg};
  // Moves the camera back until each position lies within the window.
  const double half = half_height(camera) / margin;
  double back = 200;
  for (const Vector3d& place : places) {
    const Vector3d off = place - middle;
    const double across = std::max(std::abs(off.dot(camera.up)), std::abs(off.dot(right)) / aspect);
    back = std::max(back, across / half - off.dot(forward));
  }
  camera.position = middle - back * forward;
  camera.focal_point = middle;
  return camera;
}

SceneCamera turned(const SceneCamera& camera, double right_rad, double up_rad) {
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(-right_rad, camera.up) * Eigen::AngleAxisd(up_rad, camera.right()))
          .toRotationMatrix();
  SceneCamera there = camera;
  there.position = camera.focal_point + turn * (camera.position - camera.focal_point);
  const Vector3d forward = there.forward();
  there.up = turn * camera.up;
  there.up = (there.up - there.up.dot(forward) * forward).normalized();
  return there;
}

SceneCamera zoomed(const SceneCamera& camera, double factor) {
  constexpr double nearest_mm = 5, farthest_mm = 20000;
  SceneCamera there = camera;
  const double distance = std::clamp(camera.distance() / factor, nearest_mm, farthest_mm);
  there.position = camera.focal_point - distance * camera.forward();
  return there;
}

SceneCamera shifted(const SceneCamera& camera, double right, double up) {
  const double height = 2 * half_height(camera) * camera.distance();
  const Vector3d by = -height * (right * camera.right() + up * camera.up);
  SceneCamera there = camera;
  there.position += by;
  there.focal_point += by;
  return there;
}

bool obstructs(const SceneCamera& camera, const DrawnLink& link) {
  constexpr int parts = 16;
  const Vector3d along = (link.axis.to - link.axis.from) / parts;
  const double half = half_height(camera);
  for (int i = 0; i <= parts; ++i) {
    const Vector3d off = link.axis.from + i * along - camera.position;
    const double radius = i == parts ? std::max(link.radius_mm, link.joint_radius_mm) : link.radius_mm;
    if (off.norm() < radius + 0.5 * along.norm()) return true;
    const double depth = off.dot(camera.forward());
    if (depth <= 0 || depth > camera.distance()) continue;
    const double window = half * depth, aside = (off - depth * camera.forward()).norm();
    if (radius > 0.5 * window && aside < window) return true;
  }
  return false;
}

std::optional<Eigen::Vector2d> seen_at(const SceneCamera& camera, double aspect, const Vector3d& place) {
  const Vector3d off = place - camera.position;
  const double depth = off.dot(camera.forward());
  if (depth <= 1e-6) return {};
  const double scale = 1 / (depth * half_height(camera));
  return Eigen::Vector2d(off.dot(camera.right()) * scale / aspect, off.dot(camera.up) * scale);
}

}  // namespace helicarm::gui
