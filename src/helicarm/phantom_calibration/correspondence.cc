// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/correspondence.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/phantom_calibration/bundle.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Of the labelling's systematic error, in field radii: 0.3, 1, 3, 6 and 10 px at 1024 pixels a side, and
// 0.05 to 1.7 mm at a C-arm's magnification.
constexpr double tolerances[] = {4e-4, 1.5e-3, 4e-3, 8e-3, 1.4e-2};
constexpr double relabel_tolerance = 1.5e-3;
constexpr double candidate_sigma_px = 0.3;  // of a blob's middle as the image of a ball's centre; px limits
                                            // are those of images of 1024 px a side
constexpr double largest_radius_error = 0.15;
constexpr double gates_px[] = {12, 6, 4, 3};
constexpr double largest_shift_mm = 12;  // of a fiducial from its nominal place
constexpr std::size_t least_track_views = 3;

phantom::Calibrator calibrator_of(const Reconstruction& r) {
  phantom::Calibrator calibrator;
  calibrator.name = "reconstruction";
  for (std::size_t i = 0; i < r.centres.size(); ++i)
    calibrator.balls.push_back({fmt::format("{}", i), r.centres[i], r.diameters_mm[i]});
  return calibrator;
}

std::size_t labelled_views(const Reconstruction& r) {
  return std::size_t(std::ranges::count_if(r.views, [](const auto& view) { return view.has_value(); }));
}

Reconstruction with_centres_of(const phantom::Calibrator& calibrator) {
  Reconstruction r;
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    r.centres.push_back(ball.centre_in_calibrator);
    r.diameters_mm.push_back(ball.diameter_mm);
  }
  return r;
}

Expected<fiducials::Labelling> label_tolerantly(const PhantomView& view, const phantom::Calibrator& nominal) {
  Expected<fiducials::Labelling> best = fail(Reason::too_few_fiducials, "no fiducial");
  for (const double tolerance : tolerances) {
    fiducials::LabellingOptions options;
    options.systematic_sigma = tolerance;
    auto labels = fiducials::label_balls(nominal, view.candidates, view.labelling, options);
    if (!labels) continue;
    if (!best || labels->matched > best->matched) best = std::move(labels);
    if (best->matched >= int(nominal.balls.size())) break;
  }
  return best;
}

double predicted_radius(const geometry::View& view, const Vector3d& centre, double diameter_mm) {
  return diameter_mm / 2 * std::abs(view.intrinsics.fy) / view.depth(centre);
}

bool is_of_size(const fiducials::BallCandidate& candidate, double predicted_px) {
  return std::abs(std::log(candidate.radius_px / predicted_px)) < largest_radius_error;
}

std::vector<bool> taken_in(const Reconstruction& r, std::size_t view, std::size_t candidates) {
  std::vector<bool> taken(candidates, false);
  for (const int candidate : r.candidate_of[view])
    if (candidate >= 0) taken[std::size_t(candidate)] = true;
  return taken;
}

/// A point that several views show, and by which candidates.
struct Support {
  Vector3d centre;
  std::vector<int> candidate_of;  ///< per view
  int views = 0;
  double error_px = 0;
};

Support support_of(const Reconstruction& r, const std::vector<PhantomView>& views,
                   const std::vector<std::vector<bool>>& taken, const Vector3d& centre, double diameter_mm) {
  constexpr double gate_px = 4;
  Support support{centre, std::vector<int>(views.size(), -1)};
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!r.views[v] || !(r.views[v]->depth(centre) > 0)) continue;
    const Vector2d uv = r.views[v]->project(centre);
    const double radius = predicted_radius(*r.views[v], centre, diameter_mm);
    double nearest = limit_scale(views[v]) * gate_px;
    for (std::size_t k = 0; k < views[v].candidates.size(); ++k) {
      const double distance = (views[v].candidates[k].uv - uv).norm();
      if (taken[v][k] || distance >= nearest || !is_of_size(views[v].candidates[k], radius)) continue;
      nearest = distance;
      support.candidate_of[v] = int(k);
    }
    if (support.candidate_of[v] < 0) continue;
    ++support.views;
    support.error_px += nearest;
  }
  return support;
}

/// The best supported point among free candidates, within reach of a place.
std::optional<Support> best_support(const Reconstruction& r, const std::vector<PhantomView>& views,
                                    const std::vector<std::vector<bool>>& taken, double diameter_mm,
                                    const std::optional<Vector3d>& about, double reach_mm) {
  std::optional<Support> best;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      if (!r.views[i] || !r.views[j]) continue;
      for (std::size_t a = 0; a < views[i].candidates.size(); ++a)
        for (std::size_t b = 0; b < views[j].candidates.size(); ++b) {
          if (taken[i][a] || taken[j][b]) continue;
          const geometry::RayObservation ray_observations[] = {{*r.views[i], views[i].candidates[a].uv},
                                                               {*r.views[j], views[j].candidates[b].uv}};
          if (geometry::widest_angle(ray_observations) < 0.05) continue;
          const auto met = geometry::intersect(ray_observations, Eigen::MatrixXd::Identity(4, 4));
          if (!met || met->chi2 > 16 * limit_scale(views[i]) * limit_scale(views[i])) continue;
          if (about && (met->point - *about).norm() > reach_mm) continue;
          Support support = support_of(r, views, taken, met->point, diameter_mm);
          if (support.views < int(least_track_views)) continue;
          if (!best ||
              std::tuple(-support.views, support.error_px) < std::tuple(-best->views, best->error_px))
            best = std::move(support);
        }
    }
  return best;
}

/// Fiducials that fewer than two views show get the place where consistent candidates lie near them.
void find_missing(Reconstruction& r, const std::vector<PhantomView>& views) {
  for (std::size_t ball = 0; ball < r.centres.size(); ++ball) {
    int seen = 0;
    for (std::size_t v = 0; v < views.size(); ++v) seen += r.views[v] && r.candidate_of[v][ball] >= 0;
    if (seen >= 2) continue;
    std::vector<std::vector<bool>> taken;
    for (std::size_t v = 0; v < views.size(); ++v)
      taken.push_back(taken_in(r, v, views[v].candidates.size()));
    const auto found = best_support(r, views, taken, r.diameters_mm[ball], r.centres[ball], largest_shift_mm);
    if (!found) continue;
    r.centres[ball] = found->centre;
    for (std::size_t v = 0; v < views.size(); ++v) r.candidate_of[v][ball] = found->candidate_of[v];
  }
}

void label_further_views(Reconstruction& r, const std::vector<PhantomView>& views) {
  const phantom::Calibrator calibrator = calibrator_of(r);
  fiducials::LabellingOptions options;
  options.systematic_sigma = relabel_tolerance;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (r.views[v]) continue;
    const auto labels = fiducials::label_balls(calibrator, views[v].candidates, views[v].labelling, options);
    if (!labels) continue;
    r.views[v] = labels->view;
    r.candidate_of[v] = labels->candidate_of_ball;
  }
}

/// A view whose candidates miss by far more than the others' was labelled wrongly.
void drop_contradicting_views(Reconstruction& r, const std::vector<PhantomView>& views) {
  constexpr double largest_median_px = 3;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!r.views[v]) continue;
    std::vector<double> errors;
    for (std::size_t ball = 0; ball < r.centres.size(); ++ball)
      if (const int k = r.candidate_of[v][ball]; k >= 0)
        errors.push_back(
            (r.views[v]->project(r.centres[ball]) - views[v].candidates[std::size_t(k)].uv).norm());
    if (errors.size() < 6) {
      r.views[v].reset();
      continue;
    }
    if (median(std::move(errors)) > limit_scale(views[v]) * largest_median_px) r.views[v].reset();
  }
}

}  // namespace

std::vector<int> assign(const PhantomView& view, const geometry::View& pose,
                        const std::vector<Vector3d>& centres, const std::vector<double>& diameters_mm,
                        double gate_px) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t ball = 0; ball < centres.size(); ++ball) {
    if (!(pose.depth(centres[ball]) > 0)) continue;
    const Vector2d uv = pose.project(centres[ball]);
    const double radius = predicted_radius(pose, centres[ball], diameters_mm[ball]);
    for (std::size_t k = 0; k < view.candidates.size(); ++k) {
      const double distance = (view.candidates[k].uv - uv).norm();
      if (distance < gate_px && is_of_size(view.candidates[k], radius)) pairs.emplace_back(distance, ball, k);
    }
  }
  std::ranges::sort(pairs);
  std::vector<int> candidate_of(centres.size(), -1);
  std::vector<bool> taken(view.candidates.size(), false);
  for (const auto& [distance, ball, k] : pairs) {
    if (candidate_of[ball] >= 0 || taken[k]) continue;
    candidate_of[ball] = int(k);
    taken[k] = true;
  }
  return candidate_of;
}

Expected<void> readjust(Reconstruction& r, const std::vector<PhantomView>& views) {
  for (std::size_t v = 0; v < views.size(); ++v)
    if (std::ranges::count_if(r.candidate_of[v], [](int k) { return k >= 0; }) < least_images)
      r.views[v].reset();
  std::vector<int> seen(r.centres.size(), 0);
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t ball = 0; r.views[v] && ball < r.centres.size(); ++ball)
      seen[ball] += r.candidate_of[v][ball] >= 0;
  BundleProblem problem;
  std::vector<std::size_t> balls, used;
  std::vector<std::size_t> index(r.centres.size());
  for (std::size_t ball = 0; ball < r.centres.size(); ++ball) {
    if (seen[ball] < 2) continue;
    index[ball] = balls.size();
    balls.push_back(ball);
    problem.centres.push_back(r.centres[ball]);
  }
  // A nominal focal length that is not known is assumed, within a fifth.
  problem.c_arm = {calibration::IntrinsicsVariation{0, 1.4}, calibration::IntrinsicsVariation{7, 4.2}};
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!r.views[v]) continue;
    BundleView view{views[v].name, *r.views[v], views[v].prior, {}};
    if (!view.prior.focal_px)
      view.prior.focal_px = (std::abs(view.start.intrinsics.fx) + view.start.intrinsics.fy) / 2;
    problem.c_arm.focal->common =
        (views[v].prior.focal_px ? 0.01 : 0.2) * *view.prior.focal_px / view.prior.unit_px;
    for (const std::size_t ball : balls)
      if (const int k = r.candidate_of[v][ball]; k >= 0) {
        const fiducials::BallCandidate& candidate = views[v].candidates[std::size_t(k)];
        view.images.push_back({index[ball], candidate.uv,
                               std::hypot(candidate.sigma_px, limit_scale(views[v]) * candidate_sigma_px)});
      }
    problem.views.push_back(std::move(view));
    used.push_back(v);
  }
  if (used.size() < 2 || balls.size() < 6)
    return fail(Reason::too_few_fiducials, "too few fiducials are seen in two views",
                {{"n", double(balls.size())}, {"views", double(used.size())}});
  BundleOptions options;
  options.robust = true;
  options.fixed_centres = r.fixed_centres;
  const auto fit = adjust(problem, options);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  for (std::size_t i = 0; i < balls.size(); ++i) r.centres[balls[i]] = fit->centres[i];
  for (std::size_t i = 0; i < used.size(); ++i) r.views[used[i]] = fit->views[i];
  r.rms_px = fit->rms_px;
  return {};
}

Expected<void> complete(Reconstruction& r, const std::vector<PhantomView>& views) {
  for (const double gate_px : gates_px) {
    if (auto adjusted = readjust(r, views); !adjusted) return adjusted;
    drop_contradicting_views(r, views);
    label_further_views(r, views);
    if (labelled_views(r) < 2) break;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (r.views[v])
        r.candidate_of[v] =
            assign(views[v], *r.views[v], r.centres, r.diameters_mm, limit_scale(views[v]) * gate_px);
    find_missing(r, views);
  }
  return readjust(r, views);
}

void add_fiducials(Reconstruction& r, const std::vector<PhantomView>& views,
                   const std::vector<double>& diameters_mm) {
  constexpr std::size_t most_fiducials = 60;
  while (r.centres.size() < most_fiducials) {
    std::vector<std::vector<bool>> taken;
    for (std::size_t v = 0; v < views.size(); ++v)
      taken.push_back(taken_in(r, v, views[v].candidates.size()));
    std::optional<Support> best;
    double diameter = 0;
    for (const double d : diameters_mm) {
      auto found = best_support(r, views, taken, d, {}, 0);
      if (!found || (best && best->views >= found->views)) continue;
      best = std::move(found);
      diameter = d;
    }
    // A chance meeting of rays in three views of many is none.
    if (!best || best->views < std::max(int(least_track_views), int(labelled_views(r) + 1) / 2)) return;
    r.centres.push_back(best->centre);
    r.diameters_mm.push_back(diameter);
    for (std::size_t v = 0; v < views.size(); ++v) r.candidate_of[v].push_back(best->candidate_of[v]);
  }
}

Expected<Reconstruction> reconstruct_nominal(const std::vector<PhantomView>& views,
                                             const phantom::Calibrator& nominal) {
  Reconstruction r = with_centres_of(nominal);
  std::optional<Failure> failure;
  for (const PhantomView& view : views) {
    const auto labels = label_tolerantly(view, nominal);
    r.views.push_back(labels ? std::optional(labels->view) : std::nullopt);
    r.candidate_of.push_back(labels ? labels->candidate_of_ball : std::vector<int>(r.centres.size(), -1));
    if (!labels) failure = labels.error();
  }
  if (labelled_views(r) < 2)
    return tl::unexpected<Failure>(
        failure.value_or(Failure{Reason::too_few_fiducials, "no view can be labelled"}));
  if (auto completed = complete(r, views); !completed) return tl::unexpected<Failure>(completed.error());
  return r;
}

Expected<Reconstruction> reconstruct_views(const std::vector<PhantomView>& views,
                                           const phantom::Calibrator& file,
                                           std::vector<std::optional<geometry::View>> labelled) {
  Reconstruction r = with_centres_of(file);
  r.fixed_centres = true;
  r.views = std::move(labelled);
  for (std::size_t v = 0; v < views.size(); ++v)
    r.candidate_of.push_back(r.views[v] ? assign(views[v], *r.views[v], r.centres, r.diameters_mm,
                                                 limit_scale(views[v]) * gates_px[0])
                                        : std::vector<int>(r.centres.size(), -1));
  if (auto completed = complete(r, views); !completed) return tl::unexpected<Failure>(completed.error());
  return r;
}

}  // namespace helicarm::phantom_calibration
