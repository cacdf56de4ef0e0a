// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/localization/locate.h"

namespace helicarm::track {
namespace {

using geometry::RigidTransform;
using OptionalPlace = std::optional<Eigen::Vector3d>;

constexpr double median_of_chi2 = 0.4549;  // one degree of freedom
constexpr double sight_floor_px = 0.02;
constexpr std::size_t few_frames = 5;  // too few for a marker's place in its body and its deviations

/// The sequence's data while it is estimated.
struct Work {
  const TrackCase& given;
  std::size_t frames, markers, views;
  std::vector<double> times;
  std::vector<geometry::View> cameras;
  std::vector<std::vector<std::vector<std::optional<Sight>>>> sights;  // [frame][marker][view]
  std::vector<std::vector<std::optional<SightedPoint>>> points;        // [frame][marker], of two views

  std::vector<Sight> seen(std::size_t f, std::size_t m) const {
    std::vector<Sight> made;
    for (const auto& sight : sights[f][m])
      if (sight) made.push_back(*sight);
    return made;
  }
};

void locate_all(Work& work) {
  work.points.assign(work.frames, std::vector<std::optional<SightedPoint>>(work.markers));
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m)
      if (const auto seen = work.seen(f, m); seen.size() >= 2) work.points[f][m] = sighted_point(seen);
}

/// By the neighbouring frames, mm a frame.
OptionalPlace velocity_at(const Work& work, std::size_t f, std::size_t m) {
  const std::size_t before = f > 0 ? f - 1 : 0, after = std::min(f + 1, work.frames - 1);
  const auto &from = work.points[before][m], &to = work.points[after][m], &here = work.points[f][m];
  if (from && to && after > before)
    return Eigen::Vector3d((to->place - from->place) / (work.times[after] - work.times[before]));
  if (here && to && after > f)
    return Eigen::Vector3d((to->place - here->place) / (work.times[after] - work.times[f]));
  if (from && here && f > before)
    return Eigen::Vector3d((here->place - from->place) / (work.times[f] - work.times[before]));
  return std::nullopt;
}

/// The delay of each view against the first by the ray gaps of moving markers.
std::vector<ViewDelay> delays_of(const Work& work) {
  constexpr double cut = 4, floor_mm = 0.005, least_information = 400;  // 0.05 frames
  constexpr int rounds = 5;
  std::vector<ViewDelay> delays(work.views);
  for (std::size_t k = 1; k < work.views; ++k) {
    struct Gap {
      double gap, speed, variance;
    };
    std::vector<Gap> gaps;
    for (std::size_t f = 0; f < work.frames; ++f)
      for (std::size_t m = 0; m < work.markers; ++m) {
        const auto &first = work.sights[f][m][0], &other = work.sights[f][m][k];
        const auto velocity = velocity_at(work, f, m);
        if (!first || !other || !velocity || !work.points[f][m]) continue;
        const geometry::Ray from = geometry::ray_through(*first->view, first->uv),
                            to = geometry::ray_through(*other->view, other->uv);
        const Eigen::Vector3d across = from.direction.cross(to.direction);
        if (across.norm() < 1e-3) continue;
        const Eigen::Vector3d normal = across.normalized();
        double variance = floor_mm * floor_mm;
        for (const auto* sight : {&*first, &*other})
          variance += std::pow(
              sight->sigma_px * sight->view->depth(work.points[f][m]->place) / sight->view->intrinsics.fy, 2);
        gaps.push_back({(to.origin - from.origin).dot(normal), velocity->dot(normal), variance});
      }
    double delay = 0, information = 0, scale = 1;
    for (int round = 0; round < rounds; ++round) {
      std::vector<double> ratios;
      for (const Gap& gap : gaps) ratios.push_back(std::pow(gap.gap - delay * gap.speed, 2) / gap.variance);
      if (ratios.size() < 10) break;
      scale = std::max(1.0, median(std::move(ratios)) / median_of_chi2);
      double sum = 0;
      information = 0;
      for (const Gap& gap : gaps) {
        const double left = gap.gap - delay * gap.speed;
        if (round > 0 && left * left > cut * cut * scale * gap.variance) continue;
        information += gap.speed * gap.speed / gap.variance;
        sum += gap.gap * gap.speed / gap.variance;
      }
      if (information > 0) delay = sum / information;
    }
    information /= scale;
    if (information > least_information) delays[k] = {delay, 1 / std::sqrt(information), true};
  }
  return delays;
}

/// Images of a later view at the first view's moment.
void take_out_delays(Work& work, const std::vector<ViewDelay>& delays) {
  auto corrected = work.sights;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m) {
      const auto velocity = velocity_at(work, f, m);
      for (std::size_t k = 1; k < work.views; ++k) {
        auto& sight = corrected[f][m][k];
        if (!sight || !delays[k].is_known) continue;
        const auto &before = work.sights[f > 0 ? f - 1 : 0][m][k],
                   &after = work.sights[std::min(f + 1, work.frames - 1)][m][k];
        Eigen::Vector2d speed = Eigen::Vector2d::Zero();
        if (velocity && work.points[f][m])
          speed = geometry::projection_jacobian(work.cameras[k], work.points[f][m]->place) * *velocity;
        else if (f > 0 && f + 1 < work.frames && before && after)
          speed = (after->uv - before->uv) / (work.times[f + 1] - work.times[f - 1]);
        sight->uv -= delays[k].frames * speed;
        sight->sigma_px = std::hypot(sight->sigma_px, delays[k].sigma * speed.norm());
      }
    }
  work.sights = std::move(corrected);
}

/// Each marker's factor of the fits' standard deviations, by its ray gaps; of all markers where it has few.
std::vector<double> sigma_factors(Work& work) {
  constexpr double shared_frames = 30, least = 0.7, most = 10;
  std::vector<std::vector<double>> ratios(work.markers);
  std::vector<double> all;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m)
      if (const auto& point = work.points[f][m]; point && work.seen(f, m).size() == 2) {
        ratios[m].push_back(point->chi2);
        all.push_back(point->chi2);
      }
  // Between the median, which outliers do not reach, and the mean, which holds the bands' coverage.
  const auto variance = [](std::vector<double> values) {
    const double robust = median(values) / median_of_chi2;
    double sum = 0;
    for (const double value : values) sum += std::min(value, 12 * robust);
    return std::max(robust, sum / double(values.size()));
  };
  std::vector<double> factors(work.markers, 1);
  if (all.size() < 5) return factors;
  const double pooled = variance(all);
  for (std::size_t m = 0; m < work.markers; ++m) {
    const auto count = double(ratios[m].size());
    const double own = ratios[m].empty() ? pooled : variance(ratios[m]);
    factors[m] =
        std::clamp(std::sqrt((count * own + shared_frames * pooled) / (count + shared_frames)), least, most);
  }
  for (auto& frame : work.sights)
    for (std::size_t m = 0; m < work.markers; ++m)
      for (auto& sight : frame[m])
        if (sight) sight->sigma_px *= factors[m];
  return factors;
}

/// Correlation of the images' errors between neighbouring frames, by the signed ray gaps: the texture behind
/// a marker moves with it. In units of each gap's standard deviation.
double correlation_of(const Work& work) {
  constexpr double most = 0.8, least_pairs = 50, cut = 4;
  double products = 0, squares = 0, pairs = 0;
  for (std::size_t m = 0; m < work.markers; ++m) {
    std::optional<double> before;
    for (std::size_t f = 0; f < work.frames; ++f) {
      std::optional<double> now;
      const auto &first = work.sights[f][m][0], &other = work.sights[f][m][1];
      if (work.points[f][m] && first && other) {
        const geometry::Ray from = geometry::ray_through(*first->view, first->uv),
                            to = geometry::ray_through(*other->view, other->uv);
        const double sign = (to.origin - from.origin).dot(from.direction.cross(to.direction)) > 0 ? 1 : -1;
        now = std::clamp(sign * std::sqrt(work.points[f][m]->chi2), -cut, cut);
      }
      if (now && before) {
        products += *now * *before;
        squares += 0.5 * (*now * *now + *before * *before);
        ++pairs;
      }
      before = now;
    }
  }
  return pairs < least_pairs ? 0.3 : std::clamp(products / squares, 0.0, most);
}

/// A body's geometry and its poses by least squares over the markers that count.
struct Shape {
  std::vector<OptionalPlace> in_body;
  std::vector<std::optional<RigidTransform>> poses;
};

std::optional<RigidTransform> pose_from(const Work& work, const BodyPlan& plan,
                                        const std::vector<OptionalPlace>& in_body, std::size_t f,
                                        const std::vector<char>& counts) {
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (const auto& point = work.points[f][plan.markers[i]]; counts[i] && in_body[i] && point) {
      from.push_back(*in_body[i]);
      to.push_back(point->place);
    }
  if (from.size() < 3) return std::nullopt;
  return absolute_pose(from, to);
}

/// Geometry and poses in turn, from the frame that shows most markers on.
Shape shape_of(const Work& work, const BodyPlan& plan, const std::vector<char>& counts) {
  constexpr int rounds = 8;
  const std::size_t n = plan.markers.size();
  Shape shape{std::vector<OptionalPlace>(n), std::vector<std::optional<RigidTransform>>(work.frames)};
  if (!plan.geometry.empty()) {
    for (std::size_t i = 0; i < n; ++i) shape.in_body[i] = plan.geometry[i];
  } else {
    std::size_t best = 0;
    int most = -1;
    for (std::size_t f = 0; f < work.frames; ++f) {
      int seen = 0;
      for (std::size_t i = 0; i < n; ++i) seen += work.points[f][plan.markers[i]].has_value();
      if (seen > most) most = seen, best = f;
    }
    for (std::size_t i = 0; i < n; ++i)
      if (const auto& point = work.points[best][plan.markers[i]]) shape.in_body[i] = point->place;
  }
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t f = 0; f < work.frames; ++f)
      shape.poses[f] = pose_from(work, plan, shape.in_body, f, counts);
    if (!plan.geometry.empty()) break;
    for (std::size_t i = 0; i < n; ++i) {
      std::vector<Eigen::Vector3d> places;
      for (std::size_t f = 0; f < work.frames; ++f)
        if (const auto& point = work.points[f][plan.markers[i]]; shape.poses[f] && point)
          places.push_back(shape.poses[f]->inverse() * point->place);
      if (places.empty()) continue;
      // A few wrong places must not displace the mean.
      Eigen::Vector3d middle;
      for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> values;
        for (const Eigen::Vector3d& place : places) values.push_back(place[axis]);
        middle[axis] = median(std::move(values));
      }
      std::vector<double> distances;
      for (const Eigen::Vector3d& place : places) distances.push_back((place - middle).norm());
      const double limit = std::max(0.05, 4 * median(distances));
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      int count = 0;
      for (const Eigen::Vector3d& place : places)
        if ((place - middle).norm() <= limit) sum += place, ++count;
      shape.in_body[i] = count > 0 ? sum / count : middle;
    }
  }
  return shape;
}

/// Deviations of a marker in the body from its place as the others show it; nothing where they do not.
std::vector<OptionalPlace> deviations_of(const Work& work, const BodyPlan& plan, const Shape& shape,
                                         const std::vector<char>& counts, std::size_t i) {
  std::vector<char> others = counts;
  others[i] = 0;
  std::vector<OptionalPlace> deviations(work.frames);
  if (!shape.in_body[i]) return deviations;
  for (std::size_t f = 0; f < work.frames; ++f) {
    const auto& point = work.points[f][plan.markers[i]];
    const auto pose = pose_from(work, plan, shape.in_body, f, others);
    if (point && pose) deviations[f] = pose->inverse() * point->place - *shape.in_body[i];
  }
  return deviations;
}

/// A marker's shift in its bone: the largest difference of its mean places before and after a frame.
struct Shift {
  double mm = 0, noise_mm = 0;
  std::size_t frame = 0;
};

Shift shift_of(const std::vector<OptionalPlace>& deviations) {
  constexpr std::size_t least_side = 6;
  std::vector<std::size_t> at;
  std::vector<Eigen::Vector3d> sums{Eigen::Vector3d::Zero()};
  for (std::size_t f = 0; f < deviations.size(); ++f)
    if (deviations[f]) {
      at.push_back(f);
      sums.push_back(sums.back() + *deviations[f]);
    }
  Shift shift;
  const std::size_t n = at.size();
  if (n < 2 * least_side) return shift;
  double best = 0;
  for (std::size_t k = least_side; k + least_side <= n; ++k) {
    const Eigen::Vector3d before = sums[k] / double(k), after = (sums[n] - sums[k]) / double(n - k);
    const double evidence = (after - before).squaredNorm() * double(k) * double(n - k) / double(n);
    if (evidence <= best) continue;
    best = evidence;
    double squares = 0;
    for (std::size_t j = 0; j < n; ++j)
      squares += (*deviations[at[j]] - (j < k ? before : after)).squaredNorm();
    shift = {(after - before).norm(), std::sqrt(squares / double(3 * n)), at[k]};
  }
  return shift;
}

/// Names markers that moved in their bone, the farthest first, and takes them out.
void find_loose(const Work& work, const BodyPlan& plan, std::vector<char>& counts, BodySequence& body,
                Shape& shape, const std::vector<int>& frames, std::vector<Warning>& warnings) {
  constexpr double least_mm = 0.3;  // radiostereometry's limit of marker stability
  constexpr double least_sigmas = 5;
  while (std::ranges::count(counts, 1) >= 4) {
    std::optional<std::size_t> worst;
    Shift farthest;
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      if (!counts[i]) continue;
      // The others' own geometry, without this marker's pull.
      std::vector<char> others = counts;
      others[i] = 0;
      const Shape apart = shape_of(work, plan, others);
      const Shift shift = shift_of(deviations_of(work, plan, apart, counts, i));
      if (shift.mm > least_mm && shift.mm > least_sigmas * shift.noise_mm && shift.mm > farthest.mm) {
        farthest = shift;
        worst = i;
      }
    }
    if (!worst) return;
    counts[*worst] = 0;
    body.markers[*worst].moved_at = frames[farthest.frame];
    warnings.push_back(
        {Reason::marker_loose,
         fmt::format("\"{}\" moved in the body \"{}\" by {:.2f} mm at frame {}: the body's pose "
                     "does not use it",
                     work.given.markers[plan.markers[*worst]], plan.name, farthest.mm,
                     frames[farthest.frame]),
         {},
         {{"shift_mm", farthest.mm}, {"frame", double(frames[farthest.frame])}}});
    shape = shape_of(work, plan, counts);
  }
}

/// Condition number of radiostereometry (Soderkvist and Wedin 1993): of markers in metres.
double condition_of(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d sigma = extents(points) * std::sqrt(double(points.size())) / 1000;
  return 1 / std::max(1e-9, std::hypot(sigma[1], sigma[2]));
}

struct Estimated {
  Shape shape;
  std::vector<char> counts;
  std::vector<std::optional<FramePose>> poses;  // world_from_body of the body's own frame
  std::vector<Eigen::Matrix3d> spread;          // of each marker about its place by the others, body frame
  std::optional<SmoothMotion> motion;
};

std::vector<SeenMarker> seen_markers(const Work& work, const BodyPlan& plan, const Estimated& at,
                                     std::size_t f) {
  std::vector<SeenMarker> seen;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (at.counts[i] && at.shape.in_body[i])
      seen.push_back({*at.shape.in_body[i], work.seen(f, plan.markers[i])});
  return seen;
}

/// Poses of every frame with covariance; markers that do not fit are left out and the frame is warned of.
void pose_frames(const Work& work, const BodyPlan& plan, Estimated& at, BodySequence& body) {
  constexpr double misfit = 30, misfit_mm = 0.5;
  at.poses.assign(work.frames, std::nullopt);
  body.frames.assign(work.frames, {});
  std::optional<RigidTransform> last;
  for (std::size_t f = 0; f < work.frames; ++f) {
    TrackedBody& frame = body.frames[f];
    std::vector<SeenMarker> seen = seen_markers(work, plan, at, f);
    const auto sighted = [&] {
      return std::ranges::count_if(seen, [](const SeenMarker& marker) { return !marker.sights.empty(); });
    };
    if (at.shape.poses[f]) last = at.shape.poses[f];
    frame.reason = Reason::marker_lost;
    if (sighted() < 3 || !last) continue;
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
        is_dropped = true;
        continue;
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
      const bool is_odd = is_dropped || worst || full < 3;
      frame.decision = is_odd ? PoseDecision::warn : PoseDecision::accept;
      frame.reason = is_dropped || worst ? std::optional(Reason::residual_too_large)
                     : is_odd            ? std::optional(Reason::marker_lost)
                                         : std::nullopt;
      last = fit->world_from_body;
      break;
    }
  }
}

/// Poses against the first frame: the first one's error is in every other.
void against_first(std::vector<TrackedBody>& frames, const std::vector<std::optional<FramePose>>& poses,
                   const Eigen::Vector3d& centre_in_body, const FramePose& first) {
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (!poses[f]) continue;
    FramePose made{poses[f]->pose * first.pose.inverse(), poses[f]->covariance};
    RigidCovariance turned = RigidCovariance::Zero();
    turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = made.pose.rotation;
    made.covariance += turned * first.covariance * turned.transpose();
    if (f == 0) made = {RigidTransform{}, RigidCovariance::Zero()};
    frames[f].pose = made;
    frames[f].centre = poses[f]->pose * centre_in_body;
  }
}

/// What the markers of a body deviate from their places.
void learn_deviations(const Work& work, const BodyPlan& plan, Estimated& at, BodySequence& body) {
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
    if (n < 3) continue;
    const double left = 3 * n - 6;
    squares += here;
    by_images += traces * left / (3 * n);
    freedom += left;
  }
  const double shown = double(work.frames) > 1 ? double(work.frames - 1) / double(work.frames) : 1;
  if (freedom > 0) body.deviation_mm = std::sqrt(std::max(0.0, (squares / shown - by_images) / freedom));
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    const auto deviations = deviations_of(work, plan, at.shape, at.counts, i);
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    int count = 0;
    for (std::size_t f = 0; f < work.frames; ++f) {
      if (!deviations[f] || !at.shape.poses[f]) continue;
      const Eigen::Matrix3d turn = at.shape.poses[f]->rotation;
      products += *deviations[f] * deviations[f]->transpose() -
                  turn.transpose() * work.points[f][plan.markers[i]]->covariance * turn;
      ++count;
    }
    // Never less than the deviation alone; a marker with few frames has that of the body, twice, and one with
    // fewer still may be another disc.
    const double least = std::pow(body.deviation_mm, 2) + 1e-6;
    constexpr double few_mm = 0.7;
    Eigen::Matrix3d spread = (at.counts[i] ? 4 * least : few_mm * few_mm) * Eigen::Matrix3d::Identity();
    if (at.counts[i] && count > int(few_frames)) {
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(products / count);
      spread = parts.eigenvectors() * parts.eigenvalues().cwiseMax(least).asDiagonal() *
               parts.eigenvectors().transpose();
    }
    at.spread.push_back(spread);
    body.markers[i].loose_mm = std::sqrt(spread.trace() / 3);
    if (at.shape.in_body[i]) {
      Eigen::Matrix3d covariance = spread / std::max(1, count);
      body.markers[i].in_body = {*at.shape.in_body[i], covariance};
    }
  }
}

/// The place of a marker by the other markers of its body in this frame.
std::optional<FramePlace> place_by_body(const Work& work, const BodyPlan& plan, const Estimated& at,
                                        const BodySequence& body, std::size_t i, std::size_t f,
                                        const std::optional<SmoothMotion>& smooth) {
  if (!at.shape.in_body[i] || body.markers[i].moved_at) return std::nullopt;
  std::vector<SeenMarker> others;
  std::size_t full = 0;
  for (std::size_t k = 0; k < plan.markers.size(); ++k)
    if (k != i && at.counts[k] && at.shape.in_body[k]) {
      others.push_back({*at.shape.in_body[k], work.seen(f, plan.markers[k])});
      full += others.back().sights.size() >= 2;
    }
  std::optional<FramePose> pose;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  bool by_others = false;
  if (full >= 3 && at.poses[f])
    if (const auto fit = fit_pose(at.poses[f]->pose, others, std::nullopt, {.loose_mm = body.deviation_mm})) {
      pose = FramePose{fit->world_from_body, covariance_of(*fit, others, 0)};
      centre = fit->centre;
      by_others = true;
    }
  if (!pose && smooth) {
    pose = smooth->frames[f];
    std::vector<Eigen::Vector3d> in_body;
    for (std::size_t k = 0; k < plan.markers.size(); ++k)
      if (at.counts[k] && at.shape.in_body[k]) in_body.push_back(*at.shape.in_body[k]);
    centre = pose->pose * mean_of(in_body);
  }
  if (!pose) return std::nullopt;
  const Eigen::Vector3d place = pose->pose * *at.shape.in_body[i];
  const auto slope = point_by_step(place, centre);
  const Eigen::Matrix3d turn = pose->pose.rotation;
  // Fewer others than usual carry their own deviations farther.
  const double usual = double(std::ranges::count(at.counts, 1)) - 1;
  const double fewer = by_others ? std::max(1.0, usual / double(full)) : 1;
  return FramePlace{place, slope * pose->covariance * slope.transpose() +
                               fewer * fewer * turn * at.spread[i] * turn.transpose()};
}

/// The place after more images, linearised where they put it.
FramePlace with_sights(FramePlace prior, const std::vector<Sight>& seen) {
  for (const Sight& sight : seen) {
    FramePlace next = prior;
    for (int i = 0; i < 3; ++i) {
      if (!(sight.view->depth(next.place) > 1)) return prior;
      const auto slope = geometry::projection_jacobian(*sight.view, next.place);
      Eigen::Matrix2d spread = slope * prior.covariance * slope.transpose();
      spread.diagonal().array() += sight.sigma_px * sight.sigma_px;
      const Eigen::Matrix<double, 3, 2> gain = prior.covariance * slope.transpose() * spread.inverse();
      const Eigen::Vector2d off =
          sight.uv - sight.view->project(next.place) - slope * (prior.place - next.place);
      next.place = prior.place + gain * off;
      next.covariance = prior.covariance - gain * slope * prior.covariance;
    }
    prior = next;
  }
  return prior;
}

/// By the cameras' own covariance, common to all frames.
Eigen::Matrix3d by_cameras(const Work& work, const Eigen::Vector3d& place) {
  if (work.given.camera_covariance.size() == 0) return Eigen::Matrix3d::Zero();
  calibration::Calibration calibration;
  std::vector<localization::PointObservation> seen;
  for (std::size_t k = 0; k < work.views; ++k) {
    calibration::CalibratedView view;
    view.name = work.given.views[k].images.name;
    view.view = work.cameras[k];
    view.covariance = work.given.camera_covariance.block<11, 11>(11 * Eigen::Index(k), 11 * Eigen::Index(k));
    calibration.views.push_back(view);
    if (work.cameras[k].depth(place) > 1)
      seen.push_back({k, work.cameras[k].project(place), 0.01 * Eigen::Matrix2d::Identity()});
  }
  calibration.joint_covariance = work.given.camera_covariance;
  const auto located = localization::locate("", localization::PointSource::pick, seen, calibration);
  if (!located || located->by_calibration.size() == 0) return Eigen::Matrix3d::Zero();
  return located->by_calibration * work.given.camera_covariance * located->by_calibration.transpose();
}

std::vector<MarkerDistance> distances_of(const Work& work) {
  std::vector<MarkerDistance> distances;
  for (const BodyPlan& body : work.given.bodies)
    for (std::size_t i = 0; i < body.markers.size(); ++i)
      for (std::size_t k = i + 1; k < body.markers.size(); ++k) {
        double sum = 0, squares = 0;
        int count = 0;
        for (std::size_t f = 0; f < work.frames; ++f) {
          const auto &a = work.points[f][body.markers[i]], &b = work.points[f][body.markers[k]];
          if (!a || !b) continue;
          const double distance = (a->place - b->place).norm();
          sum += distance;
          squares += distance * distance;
          ++count;
        }
        if (count < 2) continue;
        const double mean = sum / count;
        distances.push_back({body.markers[i], body.markers[k], mean,
                             std::sqrt(std::max(0.0, squares - count * mean * mean) / (count - 1)), count});
      }
  return distances;
}

/// Of the body against the reference, both against their first frames.
TrackedBody relative_of(const TrackedBody& reference, const TrackedBody& body) {
  TrackedBody made;
  made.decision = std::max(reference.decision, body.decision);
  made.reason = reference.decision > body.decision ? reference.reason : body.reason;
  made.markers = std::min(reference.markers, body.markers);
  made.centre = body.centre;
  if (!reference.pose || !body.pose) return made;
  const RigidTransform back = reference.pose->pose.inverse();
  made.centre = back * body.centre;
  // A step of the reference about its centre moves the body about its own, in the reference's axes.
  RigidCovariance carried = RigidCovariance::Identity();
  carried.bottomLeftCorner<3, 3>() = point_by_step(body.centre, reference.centre).leftCols<3>();
  RigidCovariance turned = RigidCovariance::Zero();
  turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = back.rotation;
  made.pose = FramePose{
      back * body.pose->pose,
      turned * (body.pose->covariance + carried * reference.pose->covariance * carried.transpose()) *
          turned.transpose()};
  return made;
}

/// The images' sights, rectified.
Work work_of(const TrackCase& given, const std::vector<FrameSights>& sights, Sequence& sequence) {
  Work work{given, sights.size(), given.markers.size(), given.views.size(), {}, {}, {}, {}};
  for (const TrackView& view : given.views) work.cameras.push_back(view.camera);
  for (const FrameSights& frame : sights) {
    sequence.frames.push_back(frame.frame);
    sequence.repaired += frame.repaired;
    work.times.push_back(frame.frame);
    auto& images = sequence.images.emplace_back();
    auto& of = work.sights.emplace_back(work.markers, std::vector<std::optional<Sight>>(work.views));
    for (std::size_t m = 0; m < work.markers; ++m)
      for (std::size_t k = 0; k < work.views; ++k) {
        const auto& image = frame.of[m][k];
        images.push_back(image);
        if (!image) continue;
        const auto& map = given.views[k].map;
        const Eigen::Vector2d uv =
            map ? map->rectified_from_raw(image->uv_raw).value_or(image->uv_raw) : image->uv_raw;
        of[m][k] = Sight{&work.cameras[k], uv, std::hypot(image->sigma_px, sight_floor_px)};
      }
  }
  locate_all(work);
  return work;
}

/// Estimates the views' delays, and carries their images to the first view's moment.
void correct_delays(Work& work, Sequence& sequence) {
  const auto as_seen = work.sights;
  for (int round = 0; round < 2; ++round) {
    // The velocities of the second round are free of the delay; the gaps are those of the images as seen.
    Work raw = work;
    raw.sights = as_seen;
    sequence.delays = delays_of(raw);
    work.sights = as_seen;
    take_out_delays(work, sequence.delays);
    locate_all(work);
  }
}

void warn_of_delays(const Work& work, Sequence& sequence) {
  constexpr double in_step = 0.02;
  const TrackCase& given = work.given;
  for (std::size_t k = 1; k < work.views; ++k) {
    const ViewDelay& delay = sequence.delays[k];
    if (!delay.is_known || std::abs(delay.frames) < in_step || std::abs(delay.frames) < 4 * delay.sigma)
      continue;
    Warning warning{
        Reason::cameras_not_in_step,
        fmt::format("{} exposes {:.4f} frames {} {}, standard deviation {:.4f}", given.views[k].images.name,
                    std::abs(delay.frames), delay.frames > 0 ? "after" : "before", given.views[0].images.name,
                    delay.sigma),
        given.views[k].images.name,
        {{"delay_frames", delay.frames}, {"sigma_frames", delay.sigma}}};
    if (given.frame_rate_hz) {
      warning.message += fmt::format(" ({:.3f} ms)", 1000 * delay.frames / *given.frame_rate_hz);
      warning.figures["delay_ms"] = 1000 * delay.frames / *given.frame_rate_hz;
    }
    warning.message += ": its images are carried to the first camera's moment";
    sequence.warnings.push_back(std::move(warning));
  }
}

/// Which markers count, where they are in the body, and their deviations from there.
void learn_shape(const Work& work, const BodyPlan& plan, Estimated& at, BodySequence& body,
                 Sequence& sequence) {
  for (const std::size_t marker : plan.markers) body.markers.push_back({marker, {}, 0, {}});
  at.counts.assign(plan.markers.size(), 1);
  // A marker that two views show in a few frames alone, perhaps wrongly, determines no pose.
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    std::size_t shown = 0;
    for (std::size_t f = 0; f < work.frames; ++f) shown += work.points[f][plan.markers[i]].has_value();
    at.counts[i] = shown >= std::min(few_frames + 1, (work.frames + 1) / 2);
  }
  at.shape = shape_of(work, plan, at.counts);
  find_loose(work, plan, at.counts, body, at.shape, sequence.frames, sequence.warnings);
  learn_deviations(work, plan, at, body);
}

/// The smooth motion, and the frames' poses against the first one.
void smooth_body(const Work& work, Estimated& at, BodySequence& body, const Eigen::Vector3d& centre,
                 double correlation) {
  // Of correlated errors, as many independent ones as their means' variance shows.
  const double fewer = (1 + correlation) / (1 - correlation);
  std::vector<std::optional<FramePose>> measured = at.poses;
  for (auto& pose : measured)
    if (pose) pose->covariance *= fewer;
  at.motion = smooth_poses(work.times, measured, centre);
  const auto& motion = at.motion;
  if (motion) {
    body.prior = motion->prior;
    std::vector<std::optional<FramePose>> smooth;
    for (const FramePose& pose : motion->frames) smooth.emplace_back(pose);
    against_first(body.smoothed, smooth, centre, *smooth.front());
    for (std::size_t f = 0; f < work.frames; ++f) {
      TrackedBody& frame = body.smoothed[f];
      const TrackedBody& own = body.frames[f];
      frame.markers = own.markers;
      frame.rms_mm = own.rms_mm;
      frame.reason = own.reason;
      frame.decision = at.poses[f] ? own.decision : PoseDecision::warn;
    }
  }
  // The first frame's own pose, or, where it has none, the smooth one.
  if (const auto first = at.poses.front() ? at.poses.front()
                         : motion         ? std::optional(motion->frames.front())
                                          : std::nullopt)
    against_first(body.frames, at.poses, centre, *first);
  for (TrackedBody& frame : body.frames)
    if (!frame.pose) frame.decision = PoseDecision::refuse;
}

/// A body's geometry, poses and motion; one whose markers do not determine its poses has none, and a warning
/// says why.
void estimate_body(const Work& work, const BodyPlan& plan, Estimated& at, BodySequence& body,
                   Sequence& sequence) {
  constexpr double worst_turn_deg = 5, condition_limit = 150;
  learn_shape(work, plan, at, body, sequence);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (at.counts[i] && at.shape.in_body[i]) points.push_back(*at.shape.in_body[i]);
  body.frames.assign(work.frames, {});
  body.smoothed.assign(work.frames, {});
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
  body.condition_per_m = condition_of(points);
  pose_frames(work, plan, at, body);
  std::vector<double> turns;
  for (const auto& pose : at.poses)
    if (pose)
      turns.push_back(
          std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(pose->covariance.topLeftCorner<3, 3>())
                        .eigenvalues()[2]) *
          180 / EIGEN_PI);
  if (turns.empty()) {
    refuse("in no frame are three of its markers seen");
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
  smooth_body(work, at, body, mean_of(points), sequence.correlation);
}

/// A marker's places by its own images alone, smoothed over the sequence.
std::optional<std::vector<FramePlace>> smoothed_alone(const Work& work, std::size_t m) {
  std::vector<std::optional<FramePlace>> measured;
  for (std::size_t f = 0; f < work.frames; ++f) {
    auto& made = measured.emplace_back();
    if (const auto& met = work.points[f][m]) made = FramePlace{met->place, met->covariance};
  }
  return smooth_places(work.times, measured);
}

/// A marker in every frame: by two views, else by its body or its own smooth motion and what one view shows.
void place_marker(const Work& work, const std::vector<Estimated>& bodies, std::size_t m, Sequence& sequence) {
  constexpr double lost_mm = 5;
  const auto holder = std::ranges::find_if(
      work.given.bodies, [&](const BodyPlan& body) { return std::ranges::count(body.markers, m) > 0; });
  std::optional<std::vector<FramePlace>> alone;
  bool is_smoothed = false;
  Eigen::Matrix3d of_cameras = Eigen::Matrix3d::Zero();
  bool is_first = true;
  for (std::size_t f = 0; f < work.frames; ++f) {
    TrackedMarker& marker = sequence.markers[f][m];
    const auto seen = work.seen(f, m);
    for (std::size_t k = 0; k < work.views; ++k)
      if (work.sights[f][m][k]) marker.views.push_back(k);
    if (const auto& point = work.points[f][m]) {
      marker.status = MarkerStatus::tracked;
      marker.place = FramePlace{point->place, point->covariance};
      marker.ray_gap_mm = point->ray_gap_mm;
    } else {
      std::optional<FramePlace> guess;
      if (holder != work.given.bodies.end()) {
        const auto b = std::size_t(holder - work.given.bodies.begin());
        const auto i = std::size_t(std::ranges::find(holder->markers, m) - holder->markers.begin());
        guess = place_by_body(work, *holder, bodies[b], sequence.bodies[b], i, f, bodies[b].motion);
      }
      if (!guess) {
        if (!is_smoothed) alone = smoothed_alone(work, m), is_smoothed = true;
        if (alone) guess = (*alone)[f];
      }
      if (guess) {
        const FramePlace place = with_sights(*guess, seen);
        const double sigma =
            std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(place.covariance).eigenvalues()[2]);
        if (sigma < lost_mm) {
          marker.status = seen.empty() ? MarkerStatus::predicted : MarkerStatus::one_view;
          marker.place = place;
        }
      }
    }
    if (!marker.place) continue;
    if (is_first) of_cameras = by_cameras(work, marker.place->place), is_first = false;
    marker.place->covariance += of_cameras;
  }
}

void warn_of_lost_markers(const Work& work, Sequence& sequence) {
  for (std::size_t m = 0; m < work.markers; ++m) {
    std::vector<int> lost;
    for (std::size_t f = 0; f < work.frames; ++f)
      if (sequence.markers[f][m].status == MarkerStatus::lost) lost.push_back(sequence.frames[f]);
    if (!lost.empty())
      sequence.warnings.push_back(
          {Reason::marker_lost,
           fmt::format("\"{}\" is lost in {} of {} frames, first in frame {}: hidden in both "
                       "views for too long, or outside the images",
                       work.given.markers[m], lost.size(), work.frames, lost.front()),
           {},
           {{"frames", double(lost.size())}, {"first", double(lost.front())}}});
  }
}

}  // namespace

Sequence estimate_sequence(const TrackCase& given, const std::vector<FrameSights>& sights) {
  Sequence sequence;
  sequence.warnings = given.warnings;
  Work work = work_of(given, sights, sequence);
  correct_delays(work, sequence);
  warn_of_delays(work, sequence);
  sequence.sigma_factor = sigma_factors(work);
  locate_all(work);
  sequence.correlation = correlation_of(work);
  sequence.distances = distances_of(work);
  std::vector<Estimated> bodies(given.bodies.size());
  sequence.bodies.resize(given.bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b)
    estimate_body(work, given.bodies[b], bodies[b], sequence.bodies[b], sequence);
  sequence.markers.assign(work.frames, std::vector<TrackedMarker>(work.markers));
  for (std::size_t m = 0; m < work.markers; ++m) place_marker(work, bodies, m, sequence);
  for (std::size_t f = 0; f < work.frames; ++f)
    sequence.complete += std::ranges::all_of(sequence.markers[f], [](const TrackedMarker& marker) {
      return marker.status == MarkerStatus::tracked;
    });
  warn_of_lost_markers(work, sequence);
  for (std::size_t b = 1; b < sequence.bodies.size(); ++b) {
    auto& relative = sequence.relative.emplace_back();
    for (std::size_t f = 0; f < work.frames; ++f)
      relative.push_back(relative_of(sequence.bodies[0].smoothed[f], sequence.bodies[b].smoothed[f]));
  }
  return sequence;
}

}  // namespace helicarm::track
