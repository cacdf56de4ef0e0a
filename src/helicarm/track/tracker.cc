// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::track {
namespace {

constexpr double forget = 0.85;  // of a running mean square, a frame
constexpr double least_acceleration_mm = 0.15, least_shift_mm = 0.12, least_turn_rad = 0.004;
constexpr double geometry_frames = 25;   // that a marker's place in its body remembers
constexpr double delay_spread = 0.3;     // standard deviation of the cameras' delay beforehand, frames
constexpr double sight_floor_px = 0.05;  // of a fit, by the texture behind a marker
constexpr double least_extent_mm = 1;    // of a body's markers from their common line

double window_reach(double sigma_px) { return std::clamp(4 * sigma_px + 2, 4.0, 45.0); }

double mean_square(double rms, double squares, double count) {
  return std::sqrt(forget * rms * rms + (1 - forget) * squares / count);
}

}  // namespace

double Tracker::Delay::sigma() const { return 1 / std::sqrt(information); }

Eigen::Vector2d Tracker::rectified(std::size_t view, const Eigen::Vector2d& raw) const {
  const auto& map = given_->views[view].map;
  return map ? map->rectified_from_raw(raw).value_or(raw) : raw;
}

Eigen::Vector2d Tracker::raw(std::size_t view, const Eigen::Vector2d& uv) const {
  const auto& map = given_->views[view].map;
  return map ? map->raw_from_rectified(uv) : uv;
}

double Tracker::radius_px(std::size_t view, const Eigen::Vector3d& place) const {
  return given_->diameter_mm / 2 * std::abs(cameras_[view].intrinsics.fy) /
         std::max(1.0, cameras_[view].depth(place));
}

std::optional<PosePrior> Tracker::predicted_pose(const BodyState& body) const {
  if (body.poses == 0) return std::nullopt;
  PosePrior prior{body.pose, RigidCovariance::Zero(), body.centre};
  if (body.poses > 1) {
    // The turn is that of the frame, the shift that of the centre.
    const RigidStep step = registration::step_about(body.previous, body.pose,
                                                    body.previous * (body.pose.inverse() * body.centre));
    prior.world_from_body = registration::moved_about(body.pose, body.centre, step);
    prior.centre = prior.world_from_body * (body.pose.inverse() * body.centre);
  }
  const double grown = 1 + body.hidden;
  prior.covariance.diagonal().head<3>().setConstant(std::pow(grown * body.turn_rad, 2));
  prior.covariance.diagonal().tail<3>().setConstant(std::pow(grown * body.shift_mm, 2));
  return prior;
}

Eigen::Vector3d Tracker::velocity_of(std::size_t marker) const {
  if (const auto b = body_of_[marker]) {
    const BodyState& body = bodies_[*b];
    const auto& markers = given_->bodies[*b].markers;
    const auto i = std::size_t(std::ranges::find(markers, marker) - markers.begin());
    if (body.poses > 1 && body.seen[i] > 0)
      return predicted_pose(body)->world_from_body * body.in_body[i] - body.pose * body.in_body[i];
  }
  return markers_[marker].velocity;
}

void Tracker::expect_images(ExpectedMarker& marker, std::size_t index,
                            const Eigen::Vector3d& velocity) const {
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    ExpectedImage image;
    image.radius_px = radius_px(k, marker.place);
    image.contrast = contrast_of(index, k);
    // Discs are fitted with a free radius, which their contrast depends on.
    image.contrast.spread = std::clamp(image.contrast.spread * (1 + 0.1 * markers_[index].age[k]), 0.25, 0.8);
    image.visible = markers_[index].contrast[k] * std::exp(-0.15 * markers_[index].age[k]);
    if (k > 0 && cameras_[k].depth(marker.place) > 1) {
      const Eigen::Vector2d speed = geometry::projection_jacobian(cameras_[k], marker.place) * velocity;
      image.shift_px = delays_[k].mean() * speed;
      image.shift_sigma = delays_[k].sigma() * speed.norm();
    }
    marker.images.push_back(image);
  }
}

ExpectedMarker Tracker::expected(std::size_t marker) const {
  const MarkerState& state = markers_[marker];
  ExpectedMarker made;
  made.place = state.place + state.velocity;
  // One that is picked in one view alone is looked for where its body places it.
  if (!state.known) made.place.setConstant(std::numeric_limits<double>::quiet_NaN());
  const double sigma = std::min(15.0, state.acceleration_mm * (1 + state.hidden));
  made.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  expect_images(made, marker, state.velocity);
  return made;
}

ExpectedMarker Tracker::expected(std::size_t marker, const PosePrior& pose, double wide) const {
  const std::size_t b = *body_of_[marker];
  const BodyState& body = bodies_[b];
  const auto& markers = given_->bodies[b].markers;
  const auto i = std::size_t(std::ranges::find(markers, marker) - markers.begin());
  ExpectedMarker made;
  made.place = pose.world_from_body * body.in_body[i];
  const auto slope = point_by_step(made.place, pose.centre);
  made.covariance = wide * wide * slope * pose.covariance * slope.transpose();
  made.covariance.diagonal().array() += body.loose_mm * body.loose_mm * (1 + 4 / body.seen[i]);
  expect_images(made, marker, velocity_of(marker));
  return made;
}

std::vector<std::vector<Candidate>> Tracker::search(const std::vector<xray::XrayImage>& images,
                                                    const std::vector<ExpectedMarker>& markers,
                                                    std::optional<double> reach_px) const {
  std::vector<std::vector<Candidate>> discs(cameras_.size());
  parallel_for(cameras_.size(), 0, [&](std::size_t k) {
    std::vector<SearchWindow> windows;
    for (const ExpectedMarker& marker : markers) {
      if (!(cameras_[k].depth(marker.place) > 1)) continue;
      const auto slope = geometry::projection_jacobian(cameras_[k], marker.place);
      const Eigen::Matrix2d spread = slope * marker.covariance * slope.transpose();
      const double sigma = std::sqrt(spread.trace() / 2) + marker.images[k].shift_sigma;
      const Eigen::Vector2d at = raw(k, cameras_[k].project(marker.place) + marker.images[k].shift_px);
      if (!at.allFinite()) continue;
      windows.push_back(
          {at, reach_px.value_or(window_reach(sigma)), marker.images[k].radius_px, marker.images[k].visible});
    }
    for (const MarkerImage& image : find_markers(images[k], windows, appearance_[k]))
      discs[k].push_back({image, rectified(k, image.uv_raw)});
  });
  return discs;
}

std::vector<Sight> Tracker::sights_of(std::size_t marker, const FrameSights& sights,
                                      const Eigen::Vector3d& place, const Eigen::Vector3d& velocity) const {
  std::vector<Sight> made;
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    const auto& image = sights.of[marker][k];
    if (!image) continue;
    Eigen::Vector2d uv = rectified(k, image->uv_raw);
    double sigma = std::hypot(image->sigma_px, sight_floor_px);
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
  // From the prior moved by one marker, whichever agrees with most images.
  constexpr double cut = 50;  // chi2 of an image that counts as wrong
  const auto cost_of = [&](const geometry::RigidTransform& pose) {
    const auto at = fit_pose(pose, seen, prior, {.loose_mm = body.loose_mm, .iterations = 1});
    if (!at) return std::numeric_limits<double>::infinity();
    const RigidStep off = registration::step_about(pose, prior->world_from_body, prior->centre);
    double cost = off.dot(prior->covariance.ldlt().solve(off));
    for (const double chi2 : at->chi2) cost += std::min(cut, chi2);
    return cost;
  };
  geometry::RigidTransform best = prior->world_from_body;
  double least = cost_of(best);
  for (const SeenMarker& marker : whole)
    if (const auto moved = fit_pose(best, {&marker, 1}, prior, {.loose_mm = body.loose_mm}))
      if (const double cost = cost_of(moved->world_from_body); cost < least) {
        least = cost;
        best = moved->world_from_body;
      }
  auto fit = fit_pose(best, seen, prior, {.loose_mm = body.loose_mm, .robust = true});
  if (!fit) return std::nullopt;
  std::vector<char> determines(plan.markers.size(), 0);
  for (std::size_t k = 0; k < seen.size(); ++k)
    if (fit->weight[k] > 0.1) determines[marker_of[k]] = 1;
  fit->determining = int(std::ranges::count(determines, 1));
  // The centre of the body's markers, not of their images.
  std::vector<Eigen::Vector3d> places;
  for (const SeenMarker& marker : whole) places.push_back(fit->world_from_body * marker.in_body);
  const Eigen::Vector3d centre = mean_of(places);
  RigidCovariance moves = RigidCovariance::Identity();
  moves.bottomLeftCorner<3, 3>() = point_by_step(centre, fit->centre).leftCols<3>();
  fit->covariance = moves * fit->covariance * moves.transpose();
  fit->centre = centre;
  return fit;
}

FrameSights Tracker::look(int frame, const std::vector<xray::XrayImage>& images) const {
  const std::size_t count = markers_.size();
  std::vector<ExpectedMarker> markers;
  for (std::size_t m = 0; m < count; ++m) {
    const auto b = body_of_[m];
    const auto prior = b ? predicted_pose(bodies_[*b]) : std::nullopt;
    const auto i =
        b ? std::size_t(std::ranges::find(given_->bodies[*b].markers, m) - given_->bodies[*b].markers.begin())
          : 0;
    markers.push_back(prior && bodies_[*b].seen[i] > 0 ? expected(m, *prior, 1.5) : expected(m));
  }
  const auto sights_from = [&](const std::vector<std::vector<int>>& assigned,
                               const std::vector<std::vector<Candidate>>& from) {
    FrameSights sights{frame, {}, 0};
    for (std::size_t m = 0; m < count; ++m) {
      auto& of = sights.of.emplace_back(cameras_.size());
      for (std::size_t k = 0; k < cameras_.size(); ++k)
        if (assigned[m][k] != not_seen) of[k] = from[k][std::size_t(assigned[m][k])].image;
    }
    return sights;
  };
  auto discs = search(images, markers, std::nullopt);
  const auto by_motion = assign(cameras_, markers, discs);
  const FrameSights first = sights_from(by_motion, discs);

  // The bodies' poses of this frame place each marker within a few tenths of a millimetre.
  std::vector<ExpectedMarker> again = markers;
  std::vector<ExpectedMarker> unseen;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const auto fit = pose_of(bodies_[b], given_->bodies[b], first);
    if (!fit || fit->determining < 3) continue;
    const PosePrior pose{fit->world_from_body, fit->covariance, fit->centre};
    for (std::size_t i = 0; i < given_->bodies[b].markers.size(); ++i) {
      if (bodies_[b].seen[i] == 0) continue;
      const std::size_t m = given_->bodies[b].markers[i];
      again[m] = expected(m, pose, 1.5);
      if (std::ranges::find(by_motion[m], not_seen) != by_motion[m].end()) unseen.push_back(again[m]);
    }
  }
  constexpr double near_px = 4;
  if (!unseen.empty()) {
    const auto more = search(images, unseen, near_px);
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      for (const Candidate& disc : more[k])
        if (std::ranges::none_of(discs[k], [&](const Candidate& other) {
              return (other.image.uv_raw - disc.image.uv_raw).norm() < 0.8;
            }))
          discs[k].push_back(disc);
  }
  const auto assigned = assign(cameras_, again, discs);
  FrameSights sights = sights_from(assigned, discs);
  for (std::size_t m = 0; m < count; ++m)
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (by_motion[m][k] != not_seen && by_motion[m][k] != assigned[m][k])
        for (std::size_t other = 0; other < count; ++other)
          if (other != m && assigned[other][k] == by_motion[m][k]) ++sights.repaired;

  // A marker that has moved in its bone is where its own motion, and the rays of two views, place it.
  std::vector<std::size_t> lost;
  std::vector<ExpectedMarker> alone;
  for (std::size_t m = 0; m < count; ++m)
    if (body_of_[m] && std::ranges::all_of(assigned[m], [](int disc) { return disc == not_seen; })) {
      lost.push_back(m);
      alone.push_back(expected(m));
      alone.back().covariance += 0.7 * 0.7 * Eigen::Matrix3d::Identity();
    }
  if (lost.empty()) {
    seek_evidence(sights, again, images);
    return sights;
  }
  auto left = search(images, alone, std::nullopt);
  for (std::size_t k = 0; k < cameras_.size(); ++k)
    std::erase_if(left[k], [&](const Candidate& disc) {
      return std::ranges::any_of(sights.of, [&](const auto& of) {
        return of[k] && (of[k]->uv_raw - disc.image.uv_raw).norm() < 1.5;
      });
    });
  const auto found = assign(cameras_, alone, left);
  for (std::size_t i = 0; i < lost.size(); ++i) {
    constexpr double most_moved_mm = 3, clear_px = 0.12;
    std::vector<Sight> seen;
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (found[i][k] != not_seen) {
        const Candidate& disc = left[k][std::size_t(found[i][k])];
        if (disc.image.sigma_px < clear_px) seen.push_back({&cameras_[k], disc.uv, disc.image.sigma_px});
      }
    const auto met = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
    if (!met || (met->place - again[lost[i]].place).norm() > most_moved_mm) continue;
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (found[i][k] != not_seen) sights.of[lost[i]][k] = left[k][std::size_t(found[i][k])].image;
  }
  seek_evidence(sights, again, images);
  return sights;
}

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
      body.pose = known.empty() ? geometry::RigidTransform{} : absolute_pose(known, places);
      body.previous = body.first = body.pose;
      body.centre = mean_of(places);
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
    if (state.known && now[m].located) {
      const double grown = (1 + state.hidden) * (1 + state.hidden);
      state.acceleration_mm =
          std::clamp(mean_square(state.acceleration_mm, (moved - state.velocity).squaredNorm() / grown, 3),
                     least_acceleration_mm, 5.0);
      update_delay(m, sights, now[m].place, 0.5 * (moved + velocities[m]));
    }
    state.velocity = state.known ? moved : Eigen::Vector3d::Zero();
    state.place = now[m].place;
    state.hidden = now[m].located ? 0 : state.hidden + 1;
    state.known = true;
  }
}

Tracker::Snapshot Tracker::snapshot(const FrameSights& sights) const {
  constexpr double lost_mm = 5;
  Snapshot now;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    TrackedMarker& marker = now.markers.emplace_back();
    const MarkerState& state = markers_[m];
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (sights.of[m][k]) marker.views.push_back(k);
    const auto seen = sights_of(m, sights, state.place, state.velocity);
    const auto met = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
    const double sigma = state.acceleration_mm * (1 + state.hidden);
    if (met) {
      marker.status = MarkerStatus::tracked;
      marker.place = FramePlace{met->place, met->covariance};
      marker.ray_gap_mm = met->ray_gap_mm;
    } else if (state.known && sigma < lost_mm) {
      marker.status = seen.empty() ? MarkerStatus::predicted : MarkerStatus::one_view;
      marker.place = FramePlace{state.place, sigma * sigma * Eigen::Matrix3d::Identity()};
    }
  }
  for (const BodyState& state : bodies_) {
    TrackedBody& body = now.bodies.emplace_back();
    body.reason = Reason::marker_lost;
    body.markers = state.determining;
    if (state.poses == 0 || state.determining < 3) continue;
    body.decision = PoseDecision::accept;
    body.reason = std::nullopt;
    body.centre = state.centre;
    body.pose = FramePose{state.pose * state.first.inverse(), state.covariance};
  }
  return now;
}

Expected<Tracker> Tracker::begin(const TrackCase& given, int frame,
                                 const std::vector<xray::XrayImage>& images) {
  return guarded([&] {
    Tracker tracker(given);
    for (const TrackView& view : given.views) tracker.cameras_.push_back(view.camera);
    tracker.markers_.resize(given.markers.size());
    for (MarkerState& marker : tracker.markers_) {
      marker.contrast.assign(given.views.size(), 0);
      marker.age.assign(given.views.size(), 0);
      marker.ratio.assign(given.views.size(), 1);
    }
    tracker.contrasts_.resize(given.views.size());
    tracker.delays_.assign(given.views.size(), {1 / (delay_spread * delay_spread), 0});
    tracker.body_of_.resize(given.markers.size());
    for (std::size_t b = 0; b < given.bodies.size(); ++b) {
      for (const std::size_t marker : given.bodies[b].markers) tracker.body_of_[marker] = b;
      BodyState& body = tracker.bodies_.emplace_back();
      body.in_body.assign(given.bodies[b].markers.size(), Eigen::Vector3d::Zero());
      body.seen.assign(given.bodies[b].markers.size(), 0);
    }
    tracker.find_first(frame, images);
    tracker.check_rays();
    tracker.check_geometry();
    tracker.seek_first(images);
    tracker.absorb(tracker.first_);
    return tracker;
  });
}

void Tracker::learn_appearance(const std::vector<xray::XrayImage>& images) {
  constexpr double click_px = 6;
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    MarkerAppearance best;
    double least = 1e9;
    std::size_t most = 0;
    for (const double polarity : {1.0, -1.0})
      for (const double absorbance : {0.8, 8.0})  // like the chord's length, and a flat disc
        for (const double blur : profile_blurs()) {
          MarkerAppearance tried;
          tried.polarity = polarity;
          tried.profile = detection::BallProfile(blur, absorbance);
          tried.options = detection::fit_options_for(images[k]);
          std::vector<double> misfits, sizes;
          for (const MarkerPick& pick : given_->picks) {
            if (pick.view != k) continue;
            const double radius = radius_px(k, markers_[pick.marker].place);
            if (const auto found = picked_marker(images[k], pick.uv_raw, radius, click_px + radius, tried)) {
              misfits.push_back(found->misfit);
              sizes.push_back(std::log(found->image.radius_px / radius));
            }
          }
          if (misfits.empty() || misfits.size() + 1 < most) continue;
          // A blurred small disc looks like a sharp large one: of what fits, the stated size decides.
          const double misfit = (median(misfits) + 0.1 * std::abs(median(sizes))) / double(misfits.size());
          if (misfits.size() > most + 1 || misfit < least) {
            least = misfit;
            best = tried;
            best.radius_factor = std::exp(median(sizes));
          }
          most = std::max(most, misfits.size());
        }
    if (most == 0) best.options = detection::fit_options_for(images[k]);
    appearance_.push_back(best);
  }
}

void Tracker::find_first(int frame, const std::vector<xray::XrayImage>& images) {
  constexpr double click_sigma_px = 1.5, click_px = 6;
  // Places by the clicks alone: depth and size.
  std::vector<Eigen::Vector3d> placed;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    std::vector<Sight> clicks;
    for (const MarkerPick& pick : given_->picks)
      if (pick.marker == m)
        clicks.push_back({&cameras_[pick.view], rectified(pick.view, pick.uv_raw), click_sigma_px});
    const auto met = clicks.size() >= 2 ? sighted_point(clicks) : std::nullopt;
    if (!met) continue;
    markers_[m].place = met->place;
    placed.push_back(met->place);
  }
  if (placed.empty())
    throw BadInput(Reason::not_seen, "picks: no marker is picked in two views of the first frame");
  for (std::size_t m = 0; m < markers_.size(); ++m)
    if (markers_[m].place.isZero()) markers_[m].place = mean_of(placed);
  learn_appearance(images);

  first_.frame = frame;
  first_.of.assign(markers_.size(), std::vector<std::optional<MarkerImage>>(cameras_.size()));
  struct Snap {
    double distance;
    const MarkerPick* pick;
    MarkerImage image;
  };
  std::vector<Snap> snaps;
  for (const MarkerPick& pick : given_->picks) {
    const double radius = radius_px(pick.view, markers_[pick.marker].place), reach = click_px + radius;
    const SearchWindow window{pick.uv_raw, reach + radius, radius, 0};
    const auto nearest = picked_marker(images[pick.view], pick.uv_raw, radius, reach, appearance_[pick.view]);
    std::vector<MarkerImage> found = find_markers(images[pick.view], {&window, 1}, appearance_[pick.view]);
    // Weak discs are texture, where a clear one is near.
    for (const MarkerImage& image : found)
      if (const double distance = (image.uv_raw - pick.uv_raw).norm();
          distance < reach && has_marker_size(image, radius) && nearest && image.sigma_px < 0.15 * radius &&
          std::abs(image.contrast) > 0.5 * std::abs(nearest->image.contrast))
        snaps.push_back({distance, &pick, image});
  }
  std::ranges::stable_sort(snaps, std::less<>(), &Snap::distance);
  const auto taken = [&](const Snap& snap) {
    return std::ranges::any_of(first_.of, [&](const auto& of) {
      const auto& image = of[snap.pick->view];
      return image && (image->uv_raw - snap.image.uv_raw).norm() < 0.8;
    });
  };
  for (const Snap& snap : snaps) {
    auto& of = first_.of[snap.pick->marker][snap.pick->view];
    if (!of && !taken(snap)) of = snap.image;
  }
  for (const MarkerPick& pick : given_->picks)
    if (!first_.of[pick.marker][pick.view])
      warnings_.push_back(
          {Reason::target_not_found,
           fmt::format("frame {}: no marker of {:.1f} px in diameter within {:.0f} px of the pick \"{}\" at "
                       "{:.1f}, {:.1f}: it counts as hidden in this view; pick it again if it is visible",
                       frame, 2 * radius_px(pick.view, markers_[pick.marker].place), click_px + 2,
                       given_->markers[pick.marker], pick.uv_raw.x(), pick.uv_raw.y()),
           given_->views[pick.view].images.name,
           {{"u_px", pick.uv_raw.x()}, {"v_px", pick.uv_raw.y()}}});
  bool is_any = false;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    const auto seen = sights_of(m, first_, markers_[m].place, Eigen::Vector3d::Zero());
    is_any = is_any || seen.size() >= 2;
    if (seen.size() < 2) markers_[m].known = std::ranges::count(given_->picks, m, &MarkerPick::marker) >= 2;
  }
  if (!is_any)
    throw BadInput(
        Reason::not_seen,
        fmt::format("frame {}: no marker is found at its picks in two views: check the picks, which "
                    "are raw pixels, and \"diameter_mm\"",
                    frame));
}

void Tracker::check_rays() {
  constexpr double largest_gap_mm = 1, largest_gap_px = 4;
  const auto gap_of = [&](std::size_t first, std::size_t second, std::size_t k) -> std::optional<double> {
    const auto &a = first_.of[first][0], &b = first_.of[second][k];
    if (!a || !b) return std::nullopt;
    return geometry::gap_between(geometry::ray_through(cameras_[0], rectified(0, a->uv_raw)),
                                 geometry::ray_through(cameras_[k], rectified(k, b->uv_raw)));
  };
  for (std::size_t k = 1; k < cameras_.size(); ++k)
    for (std::size_t m = 0; m < markers_.size(); ++m) {
      const auto gap = gap_of(m, m, k);
      const double mm_per_px = cameras_[k].depth(markers_[m].place) / std::abs(cameras_[k].intrinsics.fy);
      if (!gap || *gap < std::max(largest_gap_mm, largest_gap_px * mm_per_px)) continue;
      for (std::size_t other = 0; other < markers_.size(); ++other) {
        const auto here = gap_of(m, other, k), there = gap_of(other, m, k), its = gap_of(other, other, k);
        if (other == m || !here || !there || !its) continue;
        if (*here + *there < 0.2 * (*gap + *its))
          throw BadInput(
              {Reason::markers_swapped,
               fmt::format("frame {}: the picks of \"{}\" and \"{}\" are exchanged in {} or in {}: "
                           "their rays miss each other by {:.2f} and {:.2f} mm, exchanged by {:.2f} "
                           "and {:.2f} mm: correct the names",
                           first_.frame, given_->markers[m], given_->markers[other],
                           given_->views[k].images.name, given_->views[0].images.name, *gap, *its, *here,
                           *there),
               given_->views[k].images.name,
               {{"gap_mm", *gap}, {"exchanged_mm", *here}}});
      }
      // Clicks whose rays meet are right: a disc beside one of them is not the marker's.
      const auto click_in = [&](std::size_t view) {
        return std::ranges::find_if(
            given_->picks, [&](const MarkerPick& pick) { return pick.marker == m && pick.view == view; });
      };
      const auto a = click_in(0), b = click_in(k);
      if (geometry::gap_between(geometry::ray_through(cameras_[0], rectified(0, a->uv_raw)),
                                geometry::ray_through(cameras_[k], rectified(k, b->uv_raw))) <
          std::max(largest_gap_mm, largest_gap_px * mm_per_px)) {
        const bool is_first =
            (first_.of[m][0]->uv_raw - a->uv_raw).norm() > (first_.of[m][k]->uv_raw - b->uv_raw).norm();
        const std::size_t view = is_first ? 0 : k;
        first_.of[m][view].reset();
        markers_[m].known = true;
        warnings_.push_back(
            {Reason::target_not_found,
             fmt::format("frame {}: the disc nearest to the pick \"{}\" contradicts the other view "
                         "by {:.2f} mm: the marker counts as hidden in this view",
                         first_.frame, given_->markers[m], *gap),
             given_->views[view].images.name,
             {{"gap_mm", *gap}}});
        continue;
      }
      throw BadInput({Reason::residual_too_large,
                      fmt::format("frame {}: the rays of \"{}\" in {} and {} miss each other by {:.2f} mm: a "
                                  "pick is on another marker, or the cameras are of another set-up",
                                  first_.frame, given_->markers[m], given_->views[0].images.name,
                                  given_->views[k].images.name, *gap),
                      given_->views[k].images.name,
                      {{"gap_mm", *gap}}});
    }
}

void Tracker::check_geometry() const {
  constexpr double most_mm = 0.5;  // rms, of markers about the geometry given
  std::vector<std::vector<Eigen::Vector3d>> places(given_->bodies.size());
  std::vector<std::vector<std::size_t>> indices(given_->bodies.size());
  const auto rms_of = [](const std::vector<Eigen::Vector3d>& known,
                         const std::vector<Eigen::Vector3d>& seen) {
    const geometry::RigidTransform pose = absolute_pose(known, seen);
    double squares = 0;
    for (std::size_t i = 0; i < known.size(); ++i) squares += (pose * known[i] - seen[i]).squaredNorm();
    return std::sqrt(squares / double(known.size()));
  };
  for (std::size_t b = 0; b < given_->bodies.size(); ++b)
    for (std::size_t i = 0; i < given_->bodies[b].markers.size(); ++i) {
      const std::size_t m = given_->bodies[b].markers[i];
      const auto met = sighted_point(sights_of(m, first_, markers_[m].place, Eigen::Vector3d::Zero()));
      if (!met) continue;
      places[b].push_back(met->place);
      indices[b].push_back(i);
    }
  const auto chosen = [](const std::vector<Eigen::Vector3d>& from, const std::vector<std::size_t>& at) {
    std::vector<Eigen::Vector3d> points;
    for (const std::size_t i : at) points.push_back(from[i]);
    return points;
  };
  for (std::size_t b = 0; b < given_->bodies.size(); ++b) {
    const BodyPlan& body = given_->bodies[b];
    if (body.geometry.empty() || places[b].size() < 3) continue;
    const auto known = chosen(body.geometry, indices[b]);
    const double rms = rms_of(known, places[b]);
    if (rms < most_mm) continue;
    for (std::size_t i = 0; i < known.size(); ++i)
      for (std::size_t k = i + 1; k < known.size(); ++k) {
        auto exchanged = places[b];
        std::swap(exchanged[i], exchanged[k]);
        const double there = rms_of(known, exchanged);
        if (there < most_mm && there < 0.3 * rms)
          throw BadInput(
              {Reason::markers_swapped,
               fmt::format("frame {}: \"{}\" and \"{}\" of the body \"{}\" are exchanged against its "
                           "geometry: {:.2f} mm rms, exchanged {:.2f} mm: correct the names",
                           first_.frame, given_->markers[body.markers[indices[b][i]]],
                           given_->markers[body.markers[indices[b][k]]], body.name, rms, there),
               {},
               {{"rms_mm", rms}, {"exchanged_mm", there}}});
      }
    for (std::size_t other = 0; other < given_->bodies.size(); ++other) {
      if (other == b || places[other].size() != body.geometry.size() || indices[other].size() != known.size())
        continue;
      const double there = rms_of(known, places[other]);
      if (there < most_mm && there < 0.3 * rms)
        throw BadInput(
            {Reason::bodies_exchanged,
             fmt::format("frame {}: the geometry of the body \"{}\" is that of the markers of \"{}\": "
                         "{:.2f} mm rms against {:.2f} mm: the bodies are exchanged",
                         first_.frame, body.name, given_->bodies[other].name, there, rms),
             {},
             {{"rms_mm", rms}, {"exchanged_mm", there}}});
    }
    throw BadInput(
        {Reason::residual_too_large,
         fmt::format("frame {}: the markers of the body \"{}\" differ from its geometry by {:.2f} mm "
                     "rms, limit {:g} mm: it is of another body, in another unit, or has other names",
                     first_.frame, body.name, rms, most_mm),
         {},
         {{"rms_mm", rms}, {"limit_mm", most_mm}}});
  }
}

}  // namespace helicarm::track
