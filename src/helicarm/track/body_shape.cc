// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_shape.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"

namespace helicarm::track {
namespace {

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

/// Mean square of the markers' deviations from a shape.
double misfit_of(const SequenceData& work, const BodyPlan& plan, const Shape& shape,
                 const std::vector<char>& counts) {
  double squares = 0;
  int count = 0;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t i = 0; i < plan.markers.size(); ++i)
      if (const auto& point = work.points[f][plan.markers[i]];
          counts[i] && point && shape.poses[f] && shape.in_body[i]) {
        squares += (point->place - *shape.poses[f] * *shape.in_body[i]).squaredNorm();
        ++count;
      }
  return squares / std::max(1, count);
}

}  // namespace

std::optional<RigidTransform> pose_from(const SequenceData& work, const BodyPlan& plan,
                                        const std::vector<OptionalPlace>& in_body, std::size_t f,
                                        const std::vector<char>& counts) {
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (const auto& point = work.points[f][plan.markers[i]]; counts[i] && in_body[i] && point) {
      from.push_back(*in_body[i]);
      to.push_back(point->place);
    }
  if (from.size() < 3) return std::nullopt;
  return geometry::absolute_pose(from, to);
}

Shape shape_of(const SequenceData& work, const BodyPlan& plan, const std::vector<char>& counts) {
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

std::vector<OptionalPlace> deviations_of(const SequenceData& work, const BodyPlan& plan, const Shape& shape,
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

void find_loose(const SequenceData& work, const BodyPlan& plan, std::vector<char>& counts, BodySequence& body,
                Shape& shape, const std::vector<int>& frames, std::vector<Warning>& warnings) {
  constexpr double least_mm = 0.3;  // radiostereometry's limit of marker stability
  constexpr double least_sigmas = 5;
  while (std::ranges::count(counts, 1) >= 4) {
    std::optional<std::size_t> worst;
    Shift farthest;
    double least = 0;
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      if (!counts[i]) continue;
      // The others' own geometry, without this marker's pull.
      std::vector<char> others = counts;
      others[i] = 0;
      const Shape apart = shape_of(work, plan, others);
      const Shift shift = shift_of(deviations_of(work, plan, apart, counts, i));
      if (shift.mm < least_mm || shift.mm < least_sigmas * shift.noise_mm) continue;
      // One that moves displaces the others' places by their pose; without it they are rigid.
      const double left = misfit_of(work, plan, apart, others);
      if (!worst || left < least) {
        least = left;
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
                     work.the_case.markers[plan.markers[*worst]], plan.name, farthest.mm,
                     frames[farthest.frame]),
         {},
         {{"shift_mm", farthest.mm}, {"frame", double(frames[farthest.frame])}}});
    shape = shape_of(work, plan, counts);
  }
}

}  // namespace helicarm::track
