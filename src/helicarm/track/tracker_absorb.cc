// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {
namespace {

constexpr double forget = 0.85;  // of a running mean square, a frame
constexpr double least_acceleration_mm = 0.15, least_shift_mm = 0.12, least_turn_rad = 0.004;
constexpr double geometry_frames = 25;  // that a marker's place in its body remembers
constexpr double least_extent_mm = 1;   // of a body's markers from their common line

double mean_square(double rms, double squares, double count) {
  return std::sqrt(forget * rms * rms + (1 - forget) * squares / count);
}

}  // namespace

void Tracker::update_delay(std::size_t marker, const FrameSights& sights, const Eigen::Vector3d& place,
                           const Eigen::Vector3d& velocity) {
  constexpr double floor_mm = 0.02, largest_gap_mm = 1.5;
  if (!sights.of[marker][0]) return;
  const geometry::Ray from = geometry::ray_through(cameras_[0], rectified(0, sights.of[marker][0]->uv_raw));
  for (std::size_t k = 1; k < cameras_.size(); ++k) {
    if (!sights.of[marker][k]) continue;
    const geometry::Ray to = geometry::ray_through(cameras_[k], rectified(k, sights.of[marker][k]->uv_raw));
    const Eigen::Vector3d across = from.direction.cross(to.direction);
    if (across.norm() < 1e-3) continue;
    const Eigen::Vector3d normal = across.normalized();
    const double gap = (to.origin - from.origin).dot(normal), speed = velocity.dot(normal);
    if (std::abs(gap) > largest_gap_mm) continue;
    double variance = floor_mm * floor_mm;
    for (const std::size_t v : {std::size_t(0), k})
      variance +=
          std::pow(sights.of[marker][v]->sigma_px * cameras_[v].depth(place) / cameras_[v].intrinsics.fy, 2);
    delays_[k].information += speed * speed / variance;
    delays_[k].sum += gap * speed / variance;
  }
}

void Tracker::absorb(const FrameSights& sights) {
  struct Absorbed {
    Eigen::Vector3d place;
    bool located = false;
  };
  std::vector<Absorbed> now(markers_.size());
  for (ContrastLearner& learner : contrasts_) learner.forget();
  std::vector<Eigen::Vector3d> velocities;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    ExpectedMarker guess = expected(m);
    if (!markers_[m].known) guess.place = markers_[m].place;
    velocities.push_back(velocity_of(m));
    now[m].place = guess.place;
    const auto seen = sights_of(m, sights, guess.place, velocities[m]);
    if (seen.size() >= 2) {
      if (const auto met = sighted_point(seen)) now[m] = {met->place, true};
    } else if (seen.size() == 1 && cameras_[0].depth(guess.place) > 1) {
      const auto slope = geometry::projection_jacobian(*seen[0].view, guess.place);
      Eigen::Matrix2d covariance = slope * guess.covariance * slope.transpose();
      covariance.diagonal().array() += seen[0].sigma_px * seen[0].sigma_px;
      now[m].place += guess.covariance * slope.transpose() * covariance.inverse() *
                      (seen[0].uv - seen[0].view->project(guess.place));
    }
    for (std::size_t k = 0; k < cameras_.size(); ++k) {
      ++markers_[m].age[k];
      if (const auto& image = sights.of[m][k]) {
        markers_[m].age[k] = 0;
        double& contrast = markers_[m].contrast[k];
        contrast =
            contrast > 0 ? 0.7 * contrast + 0.3 * std::abs(image->contrast) : std::abs(image->contrast);
        if (const ContrastModel model = contrasts_[k].model(); model.is_known) {
          const double sigma = contrast_sigma(*image),
                       at = std::abs(image->contrast) / model.at(image->background);
          constexpr double of_ratios = 0.1;  // their spread between the frames
          const double gain = 0.3 * of_ratios * of_ratios / (of_ratios * of_ratios + sigma * sigma);
          double& ratio = markers_[m].ratio[k];
          ratio = std::clamp(ratio + gain * (at - ratio), 0.5, 2.0);
        }
        contrasts_[k].add(*image, markers_[m].ratio[k]);
      }
    }
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    BodyState& body = bodies_[b];
    const BodyPlan& plan = given_->bodies[b];
    if (body.poses == 0) {
      std::vector<Eigen::Vector3d> known, places;
      for (std::size_t i = 0; i < plan.markers.size(); ++i)
        if (now[plan.markers[i]].located) {
          places.push_back(now[plan.markers[i]].place);
          if (!plan.geometry.empty()) known.push_back(plan.geometry[i]);
        }
      if (places.size() < 3 || extents(places)[1] < least_extent_mm) continue;
      body.pose = known.empty() ? geometry::RigidTransform{} : geometry::absolute_pose(known, places);
      body.previous = body.first = body.pose;
      body.centre = geometry::mean_of(places);
      body.determining = int(places.size());
      body.poses = 1;
      for (std::size_t i = 0; i < plan.markers.size(); ++i) {
        if (!plan.geometry.empty())
          body.in_body[i] = plan.geometry[i], body.seen[i] = geometry_frames;
        else if (now[plan.markers[i]].located)
          body.in_body[i] = now[plan.markers[i]].place, body.seen[i] = 1;
        else if (markers_[plan.markers[i]].known)  // by its picks
          body.in_body[i] = markers_[plan.markers[i]].place, body.seen[i] = 0.5;
      }
      continue;
    }
    const auto prior = predicted_pose(body);
    const auto fit = pose_of(body, plan, sights);
    const bool is_seen = fit && fit->determining > 0;
    const geometry::RigidTransform pose = fit ? fit->world_from_body : prior->world_from_body;
    if (is_seen && fit->determining >= 3) {
      const RigidStep missed = registration::step_about(prior->world_from_body, pose, prior->centre);
      const double grown = (1 + body.hidden) * (1 + body.hidden);
      body.turn_rad =
          std::max(least_turn_rad, mean_square(body.turn_rad, missed.head<3>().squaredNorm() / grown, 3));
      body.shift_mm =
          std::max(least_shift_mm, mean_square(body.shift_mm, missed.tail<3>().squaredNorm() / grown, 3));
    }
    body.previous = body.pose;
    body.pose = pose;
    body.centre = fit ? fit->centre : prior->centre;
    body.covariance = fit ? fit->covariance : prior->covariance;
    body.determining = fit ? fit->determining : 0;
    body.poses = 2;
    body.hidden = is_seen && fit->determining >= 3 ? 0 : body.hidden + 1;
    double squares = 0;
    int residuals = 0;
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      const std::size_t m = plan.markers[i];
      if (now[m].located && body.hidden == 0) {
        const Eigen::Vector3d in_body = pose.inverse() * now[m].place;
        // What another disc taught of its place in the body does not count any more.
        if (is_corrected(m, sights.frame)) body.seen[i] = 0;
        if (body.seen[i] > 0 && (in_body - body.in_body[i]).norm() < 5 * body.loose_mm) {
          squares += (in_body - body.in_body[i]).squaredNorm();
          residuals += 3;
        }
        const bool is_off = body.seen[i] > 0 && (in_body - body.in_body[i]).norm() > 3;
        if (is_off) continue;  // another disc, rather than a marker that moved in its bone
        body.seen[i] = std::min(body.seen[i] + 1, geometry_frames);
        if (plan.geometry.empty()) body.in_body[i] += (in_body - body.in_body[i]) / body.seen[i];
      } else if (!now[m].located && body.seen[i] > 0 && body.hidden < 3) {
        now[m].place = pose * body.in_body[i];
      }
    }
    if (residuals > 0) body.loose_mm = std::clamp(mean_square(body.loose_mm, squares, residuals), 0.04, 0.5);
  }
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    MarkerState& state = markers_[m];
    if (!state.known && !now[m].located) continue;
    const Eigen::Vector3d moved = now[m].place - state.place;
    const bool goes_on = state.known && !is_corrected(m, sights.frame);
    if (goes_on && now[m].located) {
      const double grown = (1 + state.hidden) * (1 + state.hidden);
      state.acceleration_mm =
          std::clamp(mean_square(state.acceleration_mm, (moved - state.velocity).squaredNorm() / grown, 3),
                     least_acceleration_mm, 5.0);
      update_delay(m, sights, now[m].place, 0.5 * (moved + velocities[m]));
    }
    state.velocity = goes_on ? moved : Eigen::Vector3d::Zero();
    state.place = now[m].place;
    state.hidden = now[m].located ? 0 : state.hidden + 1;
    state.known = true;
  }
}

}  // namespace helicarm::track
