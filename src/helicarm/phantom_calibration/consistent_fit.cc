// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/consistent_fit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "helicarm/core/parallel.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr double rejection_probability = 1e-5;
constexpr double prior_of_sigma = 8;  // degrees of freedom, as the views' calibration (outliers.cc)

/// Tail of an F(2, dof) distribution.
double chance_of(double fall, double chi2_after, int dof_after) {
  const double dof = prior_of_sigma + std::max(0, dof_after);
  const double variance = std::max(1.0, (prior_of_sigma + std::max(0.0, chi2_after)) / dof);
  return std::pow(1 + fall / variance / dof, -dof / 2);
}

std::vector<int> views_of_fiducials(const BundleProblem& problem) {
  std::vector<int> views(problem.centres.size(), 0);
  for (const BundleView& view : problem.views)
    for (const FiducialImage& image : view.images) ++views[image.fiducial];
  return views;
}

void remove_image(BundleView& view, std::size_t at) {
  view.images.erase(view.images.begin() + std::ptrdiff_t(at));
  Eigen::MatrixXd& map = view.map_covariance_px2;
  if (map.size() == 0) return;
  const auto i = Eigen::Index(at), n = map.rows();
  Eigen::MatrixXd smaller(n - 1, n - 1);
  smaller << map.topLeftCorner(i, i), map.topRightCorner(i, n - 1 - i), map.bottomLeftCorner(n - 1 - i, i),
      map.bottomRightCorner(n - 1 - i, n - 1 - i);
  map = std::move(smaller);
}

/// Starts from a fit that was made before.
void restart(BundleProblem& problem, const BundleFit& fit) {
  problem.centres = fit.centres;
  for (std::size_t v = 0; v < problem.views.size(); ++v) problem.views[v].start = fit.views[v];
}

/// The problem without a view and the fiducials that fewer than two others show; `kept` has the index that
/// each of its fiducials had.
BundleProblem without_view(const BundleProblem& problem, std::size_t left_out,
                           std::vector<std::size_t>& kept) {
  BundleProblem others = problem;
  others.views.erase(others.views.begin() + std::ptrdiff_t(left_out));
  const std::vector<int> views = views_of_fiducials(others);
  std::vector<std::size_t> index(views.size());
  others.centres.clear();
  for (std::size_t i = 0; i < views.size(); ++i)
    if (views[i] >= 2) {
      index[i] = kept.size();
      kept.push_back(i);
      others.centres.push_back(problem.centres[i]);
    }
  for (BundleView& view : others.views) {
    for (std::size_t i = view.images.size(); i-- > 0;)
      if (views[view.images[i].fiducial] < 2) remove_image(view, i);
    for (FiducialImage& image : view.images) image.fiducial = index[image.fiducial];
  }
  return others;
}

/// What the others' fit says of a further view's intrinsics.
void expect_as_others(BundleProblem& alone, const BundleProblem& others, const BundleFit& fit) {
  BundleView& view = alone.views.front();
  const double n = double(fit.views.size());
  const double hand = view.start.intrinsics.fx < 0 ? -1 : 1;
  const Eigen::Vector2d middle = view.prior.principal_px.value_or(Eigen::Vector2d::Zero());
  double focal = 0;
  Eigen::Vector2d off = Eigen::Vector2d::Zero();
  for (std::size_t v = 0; v < fit.views.size(); ++v) {
    const geometry::Intrinsics& k = fit.views[v].intrinsics;
    const geometry::IntrinsicsPrior& prior = others.views[v].prior;
    focal += (std::abs(k.fx) + k.fy) / 2 / prior.unit_px / n;
    const Eigen::Vector2d from_nominal =
        Eigen::Vector2d(k.u0, k.v0) - prior.principal_px.value_or(Eigen::Vector2d::Zero());
    off += Eigen::Vector2d((k.fx < 0 ? -1 : 1) * from_nominal.x(), from_nominal.y()) / prior.unit_px / n;
  }
  view.prior.focal_px = focal * view.prior.unit_px;
  view.prior.principal_px = middle + view.prior.unit_px * Eigen::Vector2d(hand * off.x(), off.y());
  for (auto* variation : {&alone.c_arm.focal, &alone.c_arm.principal})
    if (*variation) (*variation)->common = (*variation)->of_view / std::sqrt(n);
}

std::optional<double> left_out(const ConsistentFit& all, std::size_t v) {
  BundleProblem restarted = all.problem;
  restart(restarted, all.fit);
  std::vector<std::size_t> kept;
  BundleProblem others = without_view(restarted, v, kept);
  if (others.views.size() < 2 || others.centres.size() < 6) return std::nullopt;
  const auto fit = adjust(others);
  if (!fit) return std::nullopt;
  BundleProblem alone{fit->centres, {restarted.views[v]}, restarted.c_arm};
  BundleView& view = alone.views.front();
  for (std::size_t i = view.images.size(); i-- > 0;) {
    const auto found = std::ranges::find(kept, view.images[i].fiducial);
    if (found == kept.end())
      remove_image(view, i);
    else
      view.images[i].fiducial = std::size_t(found - kept.begin());
  }
  if (view.images.size() < 4) return std::nullopt;
  expect_as_others(alone, others, *fit);
  BundleOptions options;
  options.fixed_centres = true;
  const auto resected = adjust(alone, options);
  return resected ? std::optional(resected->rms_px) : std::nullopt;
}

}  // namespace

Expected<ConsistentFit> adjust_without_outliers(BundleProblem problem) {
  auto fit = adjust(problem);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  ConsistentFit result{std::move(problem), *std::move(fit), {}};
  std::size_t count = 0;
  for (const BundleView& view : result.problem.views) count += view.images.size();
  for (std::size_t round = 0; round < count / 3; ++round) {
    const std::vector<int> views = views_of_fiducials(result.problem);
    std::size_t worst_view = 0, worst = 0;
    double fall = 0;
    for (std::size_t v = 0; v < result.fit.falls.size(); ++v)
      for (std::size_t i = 0; i < result.fit.falls[v].size(); ++i)
        if (result.fit.falls[v][i] > fall && views[result.problem.views[v].images[i].fiducial] > 2)
          fall = result.fit.falls[v][i], worst_view = v, worst = i;
    if (chance_of(fall, result.fit.chi2 - fall, result.fit.dof - 2) > rejection_probability) break;
    const FiducialImage image = result.problem.views[worst_view].images[worst];
    remove_image(result.problem.views[worst_view], worst);
    restart(result.problem, result.fit);
    auto after = adjust(result.problem);
    if (!after) return tl::unexpected<Failure>(after.error());
    result.fit = *std::move(after);
    result.rejected.push_back({worst_view, image, fall});
  }
  for (RejectedImage& rejected : result.rejected)
    rejected.off_px = rejected.image.uv -
                      result.fit.views[rejected.view].project(result.fit.centres[rejected.image.fiducial]);
  return result;
}

std::vector<std::optional<double>> left_out_rms(const ConsistentFit& fit, unsigned threads) {
  std::vector<std::optional<double>> rms(fit.problem.views.size());
  parallel_for(rms.size(), threads, [&](std::size_t v) { rms[v] = left_out(fit, v); });
  return rms;
}

std::optional<MovedFiducial> moved_fiducial(const ConsistentFit& fit, double least_mm) {
  std::map<std::size_t, std::vector<const RejectedImage*>> of_fiducial;
  for (const RejectedImage& rejected : fit.rejected)
    of_fiducial[rejected.image.fiducial].push_back(&rejected);
  std::optional<MovedFiducial> most;
  for (const auto& [fiducial, images] : of_fiducial) {
    // What moved stays moved: a single image between others is disturbed, such as by another ball beside it.
    const bool inner = images.front()->view > 0 && images.front()->view + 1 < fit.problem.views.size();
    if (images.size() == 1 && inner) continue;
    const Eigen::Vector3d& centre = fit.fit.centres[fiducial];
    MovedFiducial moved{fiducial, 0, {}};
    std::vector<geometry::RayObservation> ray_observations;
    for (const RejectedImage* image : images) {
      const geometry::View& view = fit.fit.views[image->view];
      ray_observations.push_back({view, image->image.uv});
      moved.views.push_back(image->view);
      // In the image plane through the fiducial: at least so far.
      moved.moved_mm =
          std::max(moved.moved_mm, image->off_px.norm() * view.depth(centre) / view.intrinsics.fy);
    }
    if (ray_observations.size() > 1 && geometry::widest_angle(ray_observations) > 0.1) {
      const auto met = geometry::intersect(
          ray_observations, Eigen::MatrixXd::Identity(2 * Eigen::Index(ray_observations.size()),
                                                      2 * Eigen::Index(ray_observations.size())));
      // They must agree among themselves to a pixel.
      if (!met || met->chi2 > 2.0 * double(ray_observations.size())) continue;
      moved.moved_mm = (met->point - centre).norm();
    }
    if (moved.moved_mm < least_mm) continue;
    if (!most || moved.moved_mm > most->moved_mm) most = std::move(moved);
  }
  return most;
}

}  // namespace helicarm::phantom_calibration
