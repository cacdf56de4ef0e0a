// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/adjusted_views.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/phantom_calibration/correspondence.h"
#include "helicarm/phantom_calibration/from_scratch.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/pipeline/prior.h"

namespace helicarm::phantom_calibration {
namespace {

std::optional<bool> mirrored(const pipeline::RectifiedView& detected, const pipeline::CaseView& view,
                             bool from_scratch) {
  if (view.mirrored) return view.mirrored;
  if (from_scratch && detected.xray_image->acquisition.flip_hint) return true;
  return std::nullopt;
}

std::vector<std::optional<geometry::View>> labelled_views(
    const std::vector<pipeline::RectifiedView>& detected, const pipeline::Case& the_case) {
  std::vector<std::optional<geometry::View>> views;
  for (std::size_t v = 0; v < detected.size(); ++v) {
    fiducials::FiducialOptions options;
    options.mirrored = the_case.views[v].mirrored;
    const auto labelled = fiducials::label_fiducials(*detected[v].xray_image, detected[v].dots,
                                                     detected[v].rectification, the_case.calibrator, options);
    views.push_back(labelled ? std::optional(labelled->view) : std::nullopt);
  }
  return views;
}

/// A fiducial without a candidate at its place may have moved by more than the assignment's gate: its image
/// is the nearest free candidate of its size, unless something else covers its place. The adjustment rejects
/// it where it does not fit.
void follow_moved(const pipeline::RectifiedView& detected, const PreparedView& prepared, Reconstruction& r,
                  std::size_t v) {
  constexpr double reach_mm = 8, alike = 0.15;
  const geometry::View& pose = *r.views[v];
  const rectification::DistortionMap& map = detected.rectification.map;
  const auto candidates = fiducials::ball_candidates(detected.dots, detected.rectification);
  for (std::size_t ball = 0; ball < r.centres.size(); ++ball) {
    if (r.candidate_of[v][ball] >= 0) continue;
    const Eigen::Vector2d raw = map.raw_from_rectified(pose.project(r.centres[ball]));
    const double px_per_mm = std::abs(pose.intrinsics.fy) / pose.depth(r.centres[ball]);
    const double radius_px = r.diameters_mm[ball] / 2 * px_per_mm;
    double nearest = reach_mm * px_per_mm;
    int which = -1;
    for (std::size_t k = 0; k < prepared.dots.size(); ++k) {
      const double distance = (prepared.dots[k].centre_px - raw).norm();
      if (distance >= nearest || std::ranges::count(r.candidate_of[v], int(k)) > 0 ||
          std::abs(std::log(prepared.view.candidates[k].radius_px / radius_px)) > alike)
        continue;
      nearest = distance;
      which = int(k);
    }
    if (which < 0 || !map.shows(raw)) continue;
    const Eigen::Vector2d there = prepared.dots[std::size_t(which)].centre_px;
    const auto covers = [&](const detection::Dot& dot) {
      return dot.centre_px != there && (dot.centre_px - raw).norm() < dot.radius_px;
    };
    if (std::ranges::none_of(candidates, covers) &&
        std::ranges::none_of(detected.rectification.plate_dots, covers))
      r.candidate_of[v][ball] = which;
  }
}

using Observations = std::vector<std::vector<std::optional<Observed>>>;

Observations observe_all(const std::vector<pipeline::RectifiedView>& detected,
                         const std::vector<PreparedView>& views, const Reconstruction& r, unsigned threads) {
  Observations observed(views.size());
  parallel_for(views.size(), threads, [&](std::size_t v) {
    if (r.views[v])
      observed[v] = observe(detected[v], views[v], *r.views[v], r.centres, r.diameters_mm, r.candidate_of[v]);
  });
  return observed;
}

/// The problem of the fiducials that two views or more show; `balls` and `used` index the reconstruction.
BundleProblem problem_of(const std::vector<pipeline::RectifiedView>& detected,
                         const std::vector<PreparedView>& views, const Reconstruction& r,
                         const Observations& observed, std::vector<std::size_t>& balls,
                         std::vector<std::size_t>& used) {
  BundleProblem problem;
  problem.c_arm = pipeline::unknown_c_arm();
  const auto is_used = [&](std::size_t v) {
    const auto has_value = [](const auto& seen) { return seen.has_value(); };
    return r.views[v] && std::ranges::count_if(observed[v], has_value) >= least_images;
  };
  std::vector<std::size_t> index(r.centres.size());
  for (std::size_t ball = 0; ball < r.centres.size(); ++ball) {
    int seen = 0;
    for (std::size_t v = 0; v < views.size(); ++v) seen += is_used(v) && observed[v][ball].has_value();
    if (seen < 2) continue;
    index[ball] = balls.size();
    balls.push_back(ball);
    problem.centres.push_back(r.centres[ball]);
  }
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!is_used(v)) continue;
    BundleView view{views[v].view.name, *r.views[v], views[v].view.prior, {}};
    std::vector<Eigen::Vector2d> places;
    for (const std::size_t ball : balls)
      if (const auto& seen = observed[v][ball]) {
        view.images.push_back({index[ball], seen->uv, seen->sigma_px});
        places.push_back(seen->uv);
      }
    view.map_covariance_px2 = detected[v].rectification.map.covariance_px2(places);
    problem.views.push_back(std::move(view));
    used.push_back(v);
  }
  return problem;
}

/// Poses and centres by the observed images, which then are observed again: the offset of a ball's blob from
/// its centre depends on them, and balls that were missed are looked for.
Expected<Observations> observe_twice(const std::vector<pipeline::RectifiedView>& detected,
                                     const std::vector<PreparedView>& views, Reconstruction& r,
                                     unsigned threads) {
  Observations observed = observe_all(detected, views, r, threads);
  std::vector<std::size_t> balls, used;
  const BundleProblem problem = problem_of(detected, views, r, observed, balls, used);
  BundleOptions robust;
  robust.robust = true;
  robust.fixed_centres = r.fixed_centres;
  const auto fit = adjust(problem, robust);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  for (std::size_t i = 0; i < balls.size(); ++i) r.centres[balls[i]] = fit->centres[i];
  for (std::size_t i = 0; i < used.size(); ++i) r.views[used[i]] = fit->views[i];
  return observe_all(detected, views, r, threads);
}

/// Single balls that moved do not disturb the views: their images' weights fall.
Expected<ConsistentFit> adjust_views(BundleProblem problem) {
  BundleOptions options;
  options.robust = true;
  options.fixed_centres = true;
  auto fit = adjust(problem, options);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  return ConsistentFit{std::move(problem), *std::move(fit), {}};
}

/// B1, B2, ... by descending diameter, then by u in the first view.
void name_by_size(AdjustedViews& found) {
  const auto& first = found.observed.front();
  const geometry::View& view = found.consistent.fit.views.front();
  std::vector<std::size_t> order(found.diameters_mm.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  const auto u_of = [&](std::size_t i) {
    return first[i] ? first[i]->uv_raw.x() : view.project(found.consistent.fit.centres[i]).x();
  };
  std::ranges::sort(order, {}, [&](std::size_t i) { return std::tuple(-found.diameters_mm[i], u_of(i)); });
  found.labels.resize(order.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank)
    found.labels[order[rank]] = fmt::format("B{}", rank + 1);
  found.order = std::move(order);
}

void warn_of_missing(const Reconstruction& r, const std::vector<std::size_t>& balls,
                     const std::vector<std::size_t>& used, const std::vector<PreparedView>& views,
                     const phantom::Calibrator* nominal, std::vector<Warning>& warnings) {
  for (std::size_t v = 0; v < views.size(); ++v)
    if (std::ranges::find(used, v) == used.end())
      warnings.push_back(
          {Reason::too_few_fiducials,
           "the fiducials of this view are inconsistent with every other view: the view is not used",
           views[v].view.name,
           {}});
  for (std::size_t ball = 0; nominal && ball < r.centres.size(); ++ball)
    if (std::ranges::find(balls, ball) == balls.end())
      warnings.push_back({Reason::not_seen,
                          fmt::format("{} is seen in fewer than two views: it is not in the measured file",
                                      nominal->balls[ball].label),
                          {},
                          {}});
}

}  // namespace

Expected<AdjustedViews> adjusted_views(const std::vector<pipeline::RectifiedView>& detected,
                                       const pipeline::Case& the_case, KnownCentres known,
                                       std::size_t least_views, unsigned threads,
                                       std::vector<Warning>& warnings) {
  const bool from_scratch = known == KnownCentres::none;
  std::vector<double> kinds = the_case.diameters_mm;
  if (!from_scratch)
    for (const phantom::CalibratorBall& ball : the_case.calibrator.balls) kinds.push_back(ball.diameter_mm);
  std::ranges::sort(kinds, std::greater{});
  kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
  std::vector<PreparedView> views(detected.size());
  for (std::size_t v = 0; v < detected.size(); ++v)
    views[v] = prepared(detected[v], kinds, mirrored(detected[v], the_case.views[v], from_scratch));
  std::vector<PhantomView> plain;
  for (const PreparedView& view : views) plain.push_back(view.view);

  auto r = from_scratch ? reconstruct_from_scratch(plain, kinds)
           : known == KnownCentres::nominal
               ? reconstruct_nominal(plain, the_case.calibrator)
               : reconstruct_views(plain, the_case.calibrator, labelled_views(detected, the_case));
  if (!r) return tl::unexpected<Failure>(r.error());
  for (std::size_t v = 0; v < views.size(); ++v)
    if (r->views[v]) follow_moved(detected[v], views[v], *r, v);
  auto observed = observe_twice(detected, views, *r, threads);
  if (!observed) return tl::unexpected<Failure>(observed.error());

  std::vector<std::size_t> balls, used;
  BundleProblem problem = problem_of(detected, views, *r, *observed, balls, used);
  if (used.size() < least_views)
    return fail(Reason::too_few_views,
                fmt::format("the fiducials can be recognised in {} views only, at least {} are required",
                            used.size(), least_views),
                {{"views", double(used.size())}, {"needed", double(least_views)}});
  auto consistent =
      r->fixed_centres ? adjust_views(std::move(problem)) : adjust_without_outliers(std::move(problem));
  if (!consistent) return tl::unexpected<Failure>(consistent.error());

  AdjustedViews found{*std::move(consistent), {}, {}, {}, {}, used, {}, {}};
  for (const std::size_t ball : balls) found.diameters_mm.push_back(r->diameters_mm[ball]);
  for (const std::size_t v : used) {
    auto& of_view = found.observed.emplace_back();
    for (const std::size_t ball : balls) of_view.push_back((*observed)[v][ball]);
    found.digests.push_back(detected[v].xray_image->acquisition.instance_key);
  }
  if (from_scratch) {
    name_by_size(found);
  } else {
    found.ball_of_nominal = balls;
    found.order.resize(balls.size());
    std::iota(found.order.begin(), found.order.end(), std::size_t(0));
    for (const std::size_t ball : balls) found.labels.push_back(the_case.calibrator.balls[ball].label);
  }
  warn_of_missing(*r, balls, used, views, from_scratch ? nullptr : &the_case.calibrator, warnings);
  return found;
}

Expected<void> check_handedness(const AdjustedViews& found, const pipeline::Case& the_case,
                                const std::vector<pipeline::RectifiedView>& detected) {
  for (std::size_t v = 0; v < found.view_of_case.size(); ++v) {
    const std::size_t i = found.view_of_case[v];
    if (!pipeline::is_mirrored_without_statement(found.consistent.fit.views[v].intrinsics.fx < 0,
                                                 *detected[i].xray_image, the_case.views[i]))
      return {};
  }
  return fail(Reason::ambiguous_handedness,
              "the balls fit mirrored images only: an axis of the calibrator file has the wrong sign, or "
              "the images are mirrored, which \"mirrored\" of the views must state",
              {{"views", double(found.view_of_case.size())}});
}

std::vector<Warning> handedness_notes(const AdjustedViews& found) {
  for (const geometry::View& view : found.consistent.fit.views)
    if (view.intrinsics.fx > 0) return {};
  return {pipeline::mirrored_as_stated()};
}

}  // namespace helicarm::phantom_calibration
