// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_motion.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/track/body_rays.h"
#include "helicarm/track/body_residuals.h"
#include "helicarm/track/body_series.h"
#include "helicarm/track/first_shape.h"

namespace helicarm::track {
namespace {

constexpr std::size_t few_frames = 5;  // too few for a marker's place in its body and its deviations

std::vector<SeenMarker> seen_markers(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                     std::size_t f) {
  std::vector<SeenMarker> seen;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (at.counts[i] && at.shape.in_body[i])
      seen.push_back({*at.shape.in_body[i], work.seen(f, plan.markers[i])});
  return seen;
}

/// Poses of every frame with covariance; markers that do not fit are left out and the frame is warned of.
void pose_frames(const SequenceData& work, const BodyPlan& plan, Estimated& at, BodySequence& body) {
  constexpr double misfit = 30, misfit_mm = 0.5;
  at.poses.assign(work.frames, std::nullopt);
  at.dropped.assign(work.frames, std::nullopt);
  body.frames.assign(work.frames, {});
  std::optional<RigidTransform> last;
  for (std::size_t f = 0; f < work.frames; ++f) {
    TrackedBody& frame = body.frames[f];
    std::vector<SeenMarker> seen = seen_markers(work, plan, at, f);
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < plan.markers.size(); ++i)
      if (at.counts[i] && at.shape.in_body[i]) indices.push_back(i);
    const auto sighted = [&] {
      return std::ranges::count_if(seen, [](const SeenMarker& marker) { return !marker.sights.empty(); });
    };
    if (at.shape.poses[f]) last = at.shape.poses[f];
    frame.reason = Reason::marker_lost;
    if (work.refused[f]) frame.reason = work.refused[f];
    if (work.refused[f] || sighted() < 3 || !last) continue;
    bool is_dropped = false;
    for (int round = 0; round < 2; ++round) {
      const auto fit = fit_pose(*last, seen, std::nullopt, {.loose_mm = body.deviation_mm});
      if (!fit) break;
      std::optional<std::size_t> worst;
      for (std::size_t i = 0; i < seen.size(); ++i) {
        if (seen[i].sights.size() < 2) continue;
        const auto point = sighted_point(seen[i].sights);
        const bool is_off = fit->chi2[i] > misfit * double(seen[i].sights.size()) && point &&
                            (point->place - fit->world_from_body * seen[i].in_body).norm() > misfit_mm;
        if (is_off && (!worst || fit->chi2[i] > fit->chi2[*worst])) worst = i;
      }
      if (worst && round == 0 && sighted() > 3) {
        seen[*worst].sights.clear();
        at.dropped[f] = indices[*worst];
        is_dropped = true;
        continue;
      }
      if (worst) {
        frame.reason = Reason::residual_too_large;
        break;
      }
      const RigidCovariance covariance = covariance_of(*fit, seen, body.deviation_mm);
      if (!covariance.allFinite()) break;
      at.poses[f] = FramePose{fit->world_from_body, covariance};
      double squares = 0;
      int full = 0;
      for (const SeenMarker& marker : seen) {
        if (marker.sights.size() < 2) continue;
        if (const auto point = sighted_point(marker.sights)) {
          squares += (point->place - fit->world_from_body * marker.in_body).squaredNorm();
          ++full;
        }
      }
      frame.markers = int(sighted());
      if (full > 0) frame.rms_mm = std::sqrt(squares / full);
      frame.centre = fit->centre;
      const bool is_odd = is_dropped || full < 3;
      frame.decision = is_odd ? PoseDecision::warn : PoseDecision::accept;
      frame.reason = is_dropped ? std::optional(Reason::residual_too_large)
                     : is_odd   ? std::optional(Reason::marker_lost)
                                : std::nullopt;
      last = fit->world_from_body;
      break;
    }
  }
}

/// Without those of frames in which another disc was taken for the marker.
std::vector<OptionalPlace> without_outliers(std::vector<OptionalPlace> deviations) {
  constexpr double usual = 6, least_mm = 0.5;
  std::vector<double> sizes;
  for (const OptionalPlace& each : deviations)
    if (each) sizes.push_back(each->norm());
  if (sizes.empty()) return deviations;
  const double limit = std::max(least_mm, usual * median(std::move(sizes)));
  for (OptionalPlace& each : deviations)
    if (each && each->norm() > limit) each.reset();
  return deviations;
}

/// Of a marker from its place in its body, per axis: what the poses leave beyond the images' own errors.
double deviation_of(const SequenceData& work, const BodyPlan& plan, const Estimated& at) {
  constexpr double farthest_mm = 1;  // rms of a frame that has another disc
  double squares = 0, by_images = 0, freedom = 0;
  for (std::size_t f = 0; f < work.frames; ++f) {
    if (!at.shape.poses[f]) continue;
    int n = 0;
    double here = 0, traces = 0;
    for (std::size_t i = 0; i < plan.markers.size(); ++i)
      if (const auto& point = work.points[f][plan.markers[i]]; at.counts[i] && at.shape.in_body[i] && point) {
        here += (point->place - *at.shape.poses[f] * *at.shape.in_body[i]).squaredNorm();
        traces += point->covariance.trace();
        ++n;
      }
    if (n < 3 || here > n * farthest_mm * farthest_mm) continue;
    const double left = 3 * n - 6;
    squares += here;
    by_images += traces * left / (3 * n);
    freedom += left;
  }
  const double shown = double(work.frames) > 1 ? double(work.frames - 1) / double(work.frames) : 1;
  return freedom > 0 ? std::sqrt(std::max(0.0, (squares / shown - by_images) / freedom)) : 0;
}

/// Mean products of a marker's deviations from its place, and of its images' errors there; body frame.
struct MarkerDeviations {
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero(), by_images = Eigen::Matrix3d::Zero();
  int count = 0;
};

MarkerDeviations marker_deviations(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                   std::size_t i) {
  const auto deviations = without_outliers(deviations_of(work, plan, at.shape, at.counts, i));
  MarkerDeviations made;
  for (std::size_t f = 0; f < work.frames; ++f) {
    if (!deviations[f] || !at.shape.poses[f]) continue;
    const Eigen::Matrix3d turn = at.shape.poses[f]->rotation;
    made.products += *deviations[f] * deviations[f]->transpose();
    made.by_images += turn.transpose() * work.points[f][plan.markers[i]]->covariance * turn;
    ++made.count;
  }
  made.products /= std::max(1, made.count);
  made.by_images /= std::max(1, made.count);
  return made;
}

/// What the markers of a body deviate from their places, and how well these are known: by as many independent
/// frames as correlated errors leave, and by errors that last, which no mean of frames reduces.
void learn_deviations(const SequenceData& work, const BodyPlan& plan, const Sequence& sequence, Estimated& at,
                      BodySequence& body) {
  constexpr double few_mm = 0.7;  // one with fewer frames may still be another disc
  constexpr double prior_frames = 5;
  body.deviation_mm = deviation_of(work, plan, at);
  const double least = std::pow(body.deviation_mm, 2) + 1e-6;
  const double independent = (1 - sequence.correlation) / (1 + sequence.correlation);
  at.spread.clear();
  at.by_place.clear();
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    const MarkerDeviations own = marker_deviations(work, plan, at, i);
    const double frames = std::max(1.0, independent * own.count);
    // Never less than the deviation alone; a marker with few frames has that of the body, twice.
    Eigen::Matrix3d spread = (at.counts[i] ? 4 * least : few_mm * few_mm) * Eigen::Matrix3d::Identity();
    if (at.counts[i] && own.count > int(few_frames)) {
      const auto parts = geometry::symmetric_eigen(Eigen::Matrix3d(
          (frames * (own.products - own.by_images) + prior_frames * spread) / (frames + prior_frames)));
      spread = parts.vectors * parts.values.cwiseMax(least).asDiagonal() * parts.vectors.transpose();
    }
    spread *= (frames + prior_frames) / (frames + prior_frames - 2);  // Student: of few frames
    at.spread.push_back(spread);
    body.markers[i].loose_mm = std::sqrt(spread.trace() / 3);
    // Places that are given are free of the images' errors.
    const double averaged = sequence.lasting + (1 - sequence.lasting) / frames;
    at.by_place.push_back(spread / frames);
    if (plan.geometry.empty()) at.by_place.back() += averaged * own.by_images;
  }
}

/// Places of markers that two views show in too few frames to determine them.
void place_rare_markers(const SequenceData& work, const BodyPlan& plan, const Sequence& sequence,
                        Estimated& at, BodySequence& body) {
  const double independent = (1 - sequence.correlation) / (1 + sequence.correlation);
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    if (at.counts[i] || body.markers[i].moved_at || !plan.geometry.empty()) continue;
    const auto found = place_by_rays(work, plan, at, i, independent, sequence.lasting);
    if (!found || found->determining <= int(few_frames)) continue;
    at.shape.in_body[i] = found->place.place;
    at.by_place[i] = found->place.covariance;
    at.spread[i] = 4 * (std::pow(body.deviation_mm, 2) + 1e-6) * Eigen::Matrix3d::Identity();
    body.markers[i].loose_mm = std::sqrt(at.spread[i].trace() / 3);
  }
}

/// The markers' places in the body, in the world in which its poses are stated.
void place_in_first_frame(const Estimated& at, const RigidTransform& first, BodySequence& body) {
  for (std::size_t i = 0; i < body.markers.size(); ++i)
    if (const OptionalPlace& place = at.shape.in_body[i])
      body.markers[i].in_body =
          FramePlace{first * *place, first.rotation * at.by_place[i] * first.rotation.transpose()};
}

/// Which markers count, where they are in the body, and their deviations from there.
void learn_shape(SequenceData& work, const BodyPlan& plan, Estimated& at, BodySequence& body,
                 Sequence& sequence) {
  constexpr int rounds = 2;
  for (const std::size_t marker : plan.markers) body.markers.push_back({marker});
  at.counts.assign(plan.markers.size(), 1);
  // A marker that two views show in a few frames alone, perhaps wrongly, determines no pose.
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    std::size_t shown = 0;
    for (std::size_t f = 0; f < work.frames; ++f) shown += work.points[f][plan.markers[i]].has_value();
    at.counts[i] = shown >= std::min(few_frames + 1, (work.frames + 1) / 2);
  }
  at.shape = shape_of(work, plan, at.counts);
  find_loose(work, plan, at.counts, body, at.shape, sequence.frames, sequence.warnings);
  learn_deviations(work, plan, sequence, at, body);
  for (int round = 0; round < rounds; ++round) {
    pose_frames(work, plan, at, body);
    raise_to_residuals(work, plan, at, body.deviation_mm);
    for (const std::size_t marker : plan.markers) locate_marker(work, marker);
    at.shape = shape_of(work, plan, at.counts);
    learn_deviations(work, plan, sequence, at, body);
  }
}

}  // namespace

void estimate_body(SequenceData& work, const BodyPlan& plan, Estimated& at, BodySequence& body,
                   Sequence& sequence) {
  constexpr double worst_turn_deg = 5, condition_limit = 150;
  const auto first_warning = std::ptrdiff_t(sequence.warnings.size());
  // Learning raises the sights' standard deviations.
  std::vector<std::vector<std::vector<std::optional<Sight>>>> sights;  // [marker][frame][view]
  for (const std::size_t marker : plan.markers)
    for (auto& of = sights.emplace_back(); const auto& frame : work.sights) of.push_back(frame[marker]);
  const auto learn = [&] {
    at = {};
    body = {};
    learn_shape(work, plan, at, body, sequence);
    pose_frames(work, plan, at, body);
    return contradiction_of_first(work, plan, at, body);
  };
  auto odd = learn();
  if (odd) {
    sequence.warnings.erase(sequence.warnings.begin() + first_warning, sequence.warnings.end());
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      for (std::size_t f = 0; f < work.frames; ++f) work.sights[f][plan.markers[i]] = sights[i][f];
      locate_marker(work, plan.markers[i]);
    }
    drop_contradicting(work, plan, sequence);
    odd = learn();
  }
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (at.counts[i] && at.shape.in_body[i]) points.push_back(*at.shape.in_body[i]);
  body.smoothed.assign(work.frames, {});
  if (sequence.failure) {
    for (TrackedBody& frame : body.smoothed) frame.reason = sequence.failure->reason;
    return;
  }
  const auto refuse = [&](const std::string& why) {
    sequence.warnings.push_back({Reason::body_ill_conditioned,
                                 fmt::format("the body \"{}\" has no pose: {}", plan.name, why),
                                 {},
                                 {}});
    for (auto* frames : {&body.frames, &body.smoothed})
      for (TrackedBody& frame : *frames) {
        frame = {};
        frame.reason = Reason::body_ill_conditioned;
      }
    at.poses.assign(work.frames, std::nullopt);
  };
  if (points.size() < 3) {
    refuse(fmt::format("{} of its markers are located, three are needed", points.size()));
    return;
  }
  body.condition_per_m = track::condition_per_m(points);
  if (odd) {
    for (std::size_t f = 1; f < work.frames; ++f)
      for (const std::size_t marker : plan.markers) drop_sights(work, f, marker);
    refuse(fmt::format(
        "frame {}: \"{}\" is {:.1f} mm from where the later frames place it in the body, although "
        "its pick shows it: in later frames discs of other markers are followed, or it belongs to another "
        "body; look where, and pick the markers there too",
        sequence.frames.front(), work.the_case.markers[plan.markers[odd->marker]], odd->mm));
    return;
  }
  std::vector<double> turns;
  for (const auto& pose : at.poses)
    if (pose)
      turns.push_back(
          std::sqrt(
              geometry::symmetric_eigen(Eigen::Matrix3d(pose->covariance.topLeftCorner<3, 3>())).values[2]) *
          180 / EIGEN_PI);
  if (turns.empty()) {
    refuse("in no frame do three of its markers agree with one shape");
    return;
  }
  const double turn = median(turns);
  if (turn > worst_turn_deg || extents(points)[1] < 0.5) {
    refuse(fmt::format(
        "its markers are within {:.2f} mm of one line: its turn about it has a standard deviation "
        "of {:.1f} degrees, limit {:g}; the condition number is {:.0f} per metre",
        extents(points)[1], turn, worst_turn_deg, body.condition_per_m));
    return;
  }
  if (body.condition_per_m > condition_limit)
    sequence.warnings.push_back(
        {Reason::body_ill_conditioned,
         fmt::format("the markers of the body \"{}\" have the condition number {:.0f} per metre, limit {:g} "
                     "(radiostereometry): its turns have {:.2f} degrees of standard deviation",
                     plan.name, body.condition_per_m, condition_limit, turn),
         {},
         {{"condition_per_m", body.condition_per_m}, {"sigma_deg", turn}}});
  // Of correlated errors, as many independent ones as their means' variance shows.
  const double fewer = (1 + sequence.correlation) / (1 - sequence.correlation);
  std::vector<std::optional<FramePose>> measured = at.poses;
  for (auto& pose : measured)
    if (pose) pose->covariance *= fewer;
  at.motion = smooth_poses(work.times, measured, geometry::mean_of(points));
  place_rare_markers(work, plan, sequence, at, body);
  if (const auto first = take_motion(body, at.poses, at.motion, geometry::mean_of(points)))
    place_in_first_frame(at, first->pose, body);
}

std::optional<FramePlace> place_by_body(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                        const BodySequence& body, std::size_t i, std::size_t f,
                                        bool by_others) {
  if (!at.shape.in_body[i] || body.markers[i].moved_at) return std::nullopt;
  std::vector<SeenMarker> others;
  std::size_t full = 0;
  for (std::size_t k = 0; k < plan.markers.size(); ++k)
    if (k != i && at.counts[k] && at.shape.in_body[k] && at.dropped[f] != k) {
      others.push_back({*at.shape.in_body[k], work.seen(f, plan.markers[k])});
      full += others.back().sights.size() >= 2;
    }
  std::optional<FramePose> pose;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  bool is_by_others = false;
  if (full >= 3 && at.poses[f])
    if (const auto fit = fit_pose(at.poses[f]->pose, others, std::nullopt, {.loose_mm = body.deviation_mm})) {
      pose = FramePose{fit->world_from_body, covariance_of(*fit, others, 0)};
      centre = fit->centre;
      is_by_others = true;
    }
  if (!pose && by_others) return std::nullopt;
  if (!pose && at.motion) {
    pose = at.motion->frames[f];
    std::vector<Eigen::Vector3d> in_body;
    for (std::size_t k = 0; k < plan.markers.size(); ++k)
      if (at.counts[k] && at.shape.in_body[k]) in_body.push_back(*at.shape.in_body[k]);
    centre = pose->pose * geometry::mean_of(in_body);
  }
  if (!pose) return std::nullopt;
  const Eigen::Vector3d place = pose->pose * *at.shape.in_body[i];
  const auto slope = point_by_step(place, centre);
  const Eigen::Matrix3d turn = pose->pose.rotation;
  Eigen::Matrix3d spread = at.spread[i];
  Eigen::Matrix3d covariance = slope * pose->covariance * slope.transpose();
  if (is_by_others) {
    // The spread holds the deviations of all others; fewer average less, and carry theirs farther.
    const double fewer_than = std::max(1.0, double(others.size()) / double(full));
    spread *= fewer_than * fewer_than;
    RigidCovariance of_all = RigidCovariance::Zero(), of_seen = of_all;
    for (const SeenMarker& other : others) {
      const auto by_step = point_by_step(pose->pose * other.in_body, centre);
      of_all += by_step.transpose() * by_step;
      if (other.sights.size() >= 2) of_seen += by_step.transpose() * by_step;
    }
    const RigidCovariance fewer = geometry::inverse(of_seen) - geometry::inverse(of_all);
    if (!fewer.allFinite()) return std::nullopt;
    covariance += std::pow(body.deviation_mm, 2) * slope * fewer * slope.transpose();
  }
  covariance += turn * (spread + at.by_place[i]) * turn.transpose();
  return FramePlace{place, covariance};
}

}  // namespace helicarm::track
