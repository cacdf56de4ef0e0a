// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/delays.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::track {
namespace {

/// The delay of each view against the first by the ray gaps of moving markers.
std::vector<ViewDelay> delays_of(const SequenceData& work) {
  std::vector<ViewDelay> delays(work.views);
  for (std::size_t k = 1; k < work.views; ++k)
    if (const ViewDelay delay = delay_of(ray_gaps(work, k)).delay; delay.is_known) delays[k] = delay;
  return delays;
}

/// Images of a later view at the first view's moment.
void take_out_delays(SequenceData& work, const std::vector<ViewDelay>& delays) {
  auto corrected = work.sights;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m) {
      const auto velocity = velocity_at(work, f, m);
      for (std::size_t k = 1; k < work.views; ++k) {
        auto& sight = corrected[f][m][k];
        if (!sight || !delays[k].is_known) continue;
        const auto &before = work.sights[f > 0 ? f - 1 : 0][m][k],
                   &after = work.sights[std::min(f + 1, work.frames - 1)][m][k];
        Eigen::Vector2d speed = Eigen::Vector2d::Zero(), bend = speed;
        if (velocity && work.points[f][m])
          speed = geometry::projection_jacobian(work.cameras[k], work.points[f][m]->place) * *velocity;
        else if (f > 0 && f + 1 < work.frames && before && after)
          speed = (after->uv - before->uv) / (work.times[f + 1] - work.times[f - 1]);
        if (f > 0 && f + 1 < work.frames && before && after) {
          const double dt = 0.5 * (work.times[f + 1] - work.times[f - 1]);
          bend = (after->uv - 2 * work.sights[f][m][k]->uv + before->uv) / (dt * dt);
        }
        // Between frames a motion is anything from uniform to uniformly accelerated.
        const double by = std::abs(delays[k].frames), open = by < 1 ? by * (1 - by) / 4 : 0;
        sight->uv -= delays[k].frames * speed + (by * by / 2 + open) * bend;
        sight->sigma_px = std::hypot(sight->sigma_px, delays[k].sigma * speed.norm(), open * bend.norm());
      }
    }
  work.sights = std::move(corrected);
}

}  // namespace

std::vector<RayGap> ray_gaps(const SequenceData& work, std::size_t view) {
  constexpr double floor_mm = 0.005;
  std::vector<RayGap> gaps;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m) {
      const auto &first = work.sights[f][m][0], &other = work.sights[f][m][view];
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
      gaps.push_back({f, m, (to.origin - from.origin).dot(normal), velocity->dot(normal), variance});
    }
  return gaps;
}

GapDelay delay_of(std::span<const RayGap> gaps) {
  constexpr double cut = 4, least_information = 400;  // 0.05 frames
  constexpr int rounds = 5;
  double delay = 0, information = 0, scale = 1;
  for (int round = 0; round < rounds; ++round) {
    std::vector<double> ratios;
    for (const RayGap& gap : gaps) ratios.push_back(std::pow(gap.gap - delay * gap.speed, 2) / gap.variance);
    if (ratios.size() < 10) break;
    scale = std::max(1.0, median(std::move(ratios)) / median_of_chi2);
    double sum = 0;
    information = 0;
    for (const RayGap& gap : gaps) {
      const double left = gap.gap - delay * gap.speed;
      if (round > 0 && left * left > cut * cut * scale * gap.variance) continue;
      information += gap.speed * gap.speed / gap.variance;
      sum += gap.gap * gap.speed / gap.variance;
    }
    if (information > 0) delay = sum / information;
  }
  information /= scale;
  if (!(information > 0)) return {};
  return {{delay, 1 / std::sqrt(information), information > least_information}, scale};
}

void correct_delays(SequenceData& work, Sequence& sequence) {
  const auto as_seen = work.sights;
  for (int round = 0; round < 2; ++round) {
    // The velocities of the second round are free of the delay; the gaps are those of the images as seen.
    SequenceData raw = work;
    raw.sights = as_seen;
    sequence.delays = delays_of(raw);
    work.sights = as_seen;
    take_out_delays(work, sequence.delays);
    locate_all(work);
  }
}

void warn_of_delays(const SequenceData& work, Sequence& sequence) {
  constexpr double in_step = 0.02;
  const TrackCase& the_case = work.the_case;
  for (std::size_t k = 1; k < work.views; ++k) {
    const ViewDelay& delay = sequence.delays[k];
    if (!delay.is_known || std::abs(delay.frames) < in_step || std::abs(delay.frames) < 4 * delay.sigma)
      continue;
    Warning warning{
        Reason::cameras_not_in_step,
        fmt::format("{} exposes {:.4f} frames {} {}, standard deviation {:.4f}",
                    the_case.views[k].images.name, std::abs(delay.frames),
                    delay.frames > 0 ? "after" : "before", the_case.views[0].images.name, delay.sigma),
        the_case.views[k].images.name,
        {{"delay_frames", delay.frames}, {"sigma_frames", delay.sigma}}};
    if (the_case.frame_rate_hz) {
      warning.message += fmt::format(" ({:.3f} ms)", 1000 * delay.frames / *the_case.frame_rate_hz);
      warning.figures["delay_ms"] = 1000 * delay.frames / *the_case.frame_rate_hz;
    }
    warning.message += ": its images are carried to the first camera's moment";
    if (const double whole = std::round(delay.frames); whole != 0)
      warning.message += fmt::format(
          "; unless the cameras differ so much, set its \"frame_offset\" to {:g} and follow again",
          the_case.views[k].frame_offset - whole);
    sequence.warnings.push_back(std::move(warning));
  }
}

}  // namespace helicarm::track
