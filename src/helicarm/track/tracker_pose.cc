// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "helicarm/geometry/small_matrix.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/sighted_point.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {
namespace {

constexpr double texture_floor_px = 0.05;  // of a fit, by the texture behind a marker

/// Poses by the markers that two views show: `near` shifted to each, and those of each three.
std::vector<geometry::RigidTransform> poses_by_places(const geometry::RigidTransform& near,
                                                      const std::vector<SeenMarker>& markers) {
  constexpr std::size_t most = 10;  // beyond, three neighbours in the list do
  std::vector<Eigen::Vector3d> in_body, places;
  for (const SeenMarker& marker : markers)
    if (const auto met = marker.sights.size() >= 2 ? sighted_point(marker.sights) : std::nullopt) {
      in_body.push_back(marker.in_body);
      places.push_back(met->place);
    }
  std::vector<geometry::RigidTransform> poses;
  for (std::size_t i = 0; i < places.size(); ++i) {
    poses.push_back(near);
    poses.back().translation += places[i] - near * in_body[i];
  }
  const std::size_t reach = places.size() > most ? 3 : places.size();
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = i + 1; j < std::min(i + reach, places.size()); ++j)
      for (std::size_t k = j + 1; k < std::min(i + reach, places.size()); ++k)
        poses.push_back(geometry::absolute_pose(std::array{in_body[i], in_body[j], in_body[k]},
                                                std::array{places[i], places[j], places[k]}));
  return poses;
}

}  // namespace

std::vector<Sight> Tracker::sights_of(std::size_t marker, const FrameSights& sights,
                                      const Eigen::Vector3d& place, const Eigen::Vector3d& velocity) const {
  std::vector<Sight> made;
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    const auto& image = sights.of[marker][k];
    if (!image) continue;
    Eigen::Vector2d uv = rectified(k, image->uv_raw);
    double sigma = std::hypot(image->sigma_px, texture_floor_px);
    if (k > 0 && cameras_[k].depth(place) > 1) {
      const Eigen::Vector2d speed = geometry::projection_jacobian(cameras_[k], place) * velocity;
      uv -= delays_[k].mean() * speed;
      sigma = std::hypot(sigma, delays_[k].sigma() * speed.norm());
    }
    made.push_back({&cameras_[k], uv, sigma});
  }
  return made;
}

std::optional<PoseFit> Tracker::pose_of(const BodyState& body, const BodyPlan& plan,
                                        const FrameSights& sights) const {
  const auto prior = predicted_pose(body);
  if (!prior) return std::nullopt;
  // Each image by itself: a wrong disc in one view must not cost the marker's other one.
  std::vector<SeenMarker> seen, whole;
  std::vector<std::size_t> marker_of;
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    if (body.seen[i] == 0) continue;
    const std::vector<Sight> sights_of_it = sights_of(
        plan.markers[i], sights, prior->world_from_body * body.in_body[i], velocity_of(plan.markers[i]));
    for (const Sight& sight : sights_of_it) {
      seen.push_back({body.in_body[i], {sight}});
      marker_of.push_back(i);
    }
    if (!sights_of_it.empty()) whole.push_back({body.in_body[i], sights_of_it});
  }
  if (seen.empty()) return std::nullopt;
  constexpr double cut = 50;  // chi2 of an image that counts as wrong
  const auto cost_of = [&](const geometry::RigidTransform& pose) {
    const auto at = fit_pose(pose, seen, prior, {.loose_mm = body.loose_mm, .iterations = 1});
    if (!at) return std::numeric_limits<double>::infinity();
    const RigidStep off = registration::step_about(pose, prior->world_from_body, prior->centre);
    double cost = geometry::squared_distance(off, prior->covariance);
    for (const double chi2 : at->chi2) cost += std::min(cut, chi2);
    return cost;
  };
  geometry::RigidTransform best = prior->world_from_body;
  double least = cost_of(best);
  const auto consider = [&](const geometry::RigidTransform& pose) {
    if (const double cost = cost_of(pose); cost < least) {
      least = cost;
      best = pose;
    }
  };
  // From the prior moved by one marker, or by what two views show of the body, whichever agrees with most
  // images.
  for (const SeenMarker& marker : whole)
    if (const auto moved = fit_pose(best, {&marker, 1}, prior, {.loose_mm = body.loose_mm}))
      consider(moved->world_from_body);
  if (least > cut)
    for (const geometry::RigidTransform& pose : poses_by_places(prior->world_from_body, whole))
      consider(pose);
  auto fit = fit_pose(best, seen, prior, {.loose_mm = body.loose_mm, .robust = true});
  if (!fit) return std::nullopt;
  std::vector<char> determines(plan.markers.size(), 0);
  for (std::size_t k = 0; k < seen.size(); ++k)
    if (fit->weight[k] > 0.1) determines[marker_of[k]] = 1;
  fit->determining = int(std::ranges::count(determines, 1));
  // The centre of the body's markers, not of their images.
  std::vector<Eigen::Vector3d> places;
  for (const SeenMarker& marker : whole) places.push_back(fit->world_from_body * marker.in_body);
  const Eigen::Vector3d centre = geometry::mean_of(places);
  RigidCovariance moves = RigidCovariance::Identity();
  moves.bottomLeftCorner<3, 3>() = point_by_step(centre, fit->centre).leftCols<3>();
  fit->covariance = moves * fit->covariance * moves.transpose();
  fit->centre = centre;
  return fit;
}

}  // namespace helicarm::track
