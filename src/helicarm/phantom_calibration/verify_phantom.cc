// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/verify_phantom.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/phantom_calibration/adjusted_views.h"
#include "helicarm/phantom_calibration/diameter_scale.h"
#include "helicarm/pipeline/diagnosis/displaced_balls.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

constexpr std::size_t least_views = 2;
constexpr std::size_t least_kept = 6;

/// The percentile of chi-square with 3 degrees of freedom that one of `count` unmoved balls exceeds with a
/// probability of 5 % (the normal quantile by Abramowitz and Stegun 26.2.23).
double chi2_limit(std::size_t count) {
  const double t = std::sqrt(-2 * std::log(0.05 / double(count)));
  const double deviate =
      t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  return chi2_quantile(3, deviate);
}

/// The balls at their places in the file, whose own errors are added to their images'.
BundleProblem with_file_centres(const AdjustedViews& found, const phantom::Calibrator& file,
                                const std::vector<Eigen::Matrix3d>& covariances) {
  BundleProblem problem = found.consistent.problem;
  for (std::size_t v = 0; v < problem.views.size(); ++v)
    problem.views[v].start = found.consistent.fit.views[v];
  for (std::size_t i = 0; i < problem.centres.size(); ++i)
    problem.centres[i] = file.balls[found.ball_of_nominal[i]].centre_in_calibrator;
  for (BundleView& view : problem.views) {
    // One ball is free at a time, so the map's errors are taken as independent.
    for (Eigen::Index i = 0; i < view.map_covariance_px2.rows(); ++i) {
      double& sigma = view.images[std::size_t(i)].sigma_px;
      sigma = std::hypot(sigma, std::sqrt(view.map_covariance_px2(i, i)));
    }
    view.map_covariance_px2 = {};
    for (FiducialImage& image : view.images) {
      if (covariances.empty()) continue;
      const Eigen::Matrix3d& covariance = covariances[found.ball_of_nominal[image.fiducial]];
      const double px_per_mm =
          view.start.intrinsics.fy / view.start.depth(found.consistent.fit.centres[image.fiducial]);
      image.sigma_px = std::hypot(image.sigma_px, px_per_mm * std::sqrt(covariance.trace() / 3));
    }
  }
  return problem;
}

BundleProblem without(const BundleProblem& problem, const std::vector<bool>& out) {
  BundleProblem kept = problem;
  for (BundleView& view : kept.views)
    std::erase_if(view.images, [&](const FiducialImage& image) { return out[image.fiducial]; });
  return kept;
}

struct Place {
  Vector3d off;
  Eigen::Matrix3d covariance;
  double chi2;
  double gap_px;  ///< largest residual of its images
  bool is_moved;  ///< if chi2 is too large for an unmoved ball
};

constexpr double largest_gap_px = 2;  // beyond it the images are not those of one ball

/// The ball's distances from its images in the views.
std::vector<std::pair<double, const FiducialImage*>> residuals_of(const BundleProblem& problem,
                                                                  const std::vector<geometry::View>& views,
                                                                  std::size_t ball, const Vector3d& at) {
  std::vector<std::pair<double, const FiducialImage*>> residuals;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (const FiducialImage& image : problem.views[v].images)
      if (image.fiducial == ball) residuals.emplace_back((views[v].project(at) - image.uv).norm(), &image);
  return residuals;
}

/// Whether a ball's images at its place in the file show a move: two views contradict it, or one by more than
/// a partly hidden ball's image is off.
bool shows_move(const BundleProblem& problem, const std::vector<geometry::View>& views, std::size_t ball) {
  constexpr double largest_chi2 = 13.8;  // chi-square with 2 degrees of freedom, 0.1 %
  constexpr double largest_hidden_px = 1;
  int contradicting = 0;
  for (const auto& [off, image] : residuals_of(problem, views, ball, problem.centres[ball])) {
    if (off > largest_hidden_px) return true;
    contradicting += off * off > largest_chi2 * image->sigma_px * image->sigma_px;
  }
  return contradicting >= 2;
}

/// A ball's place by views that the others (those not `out`) calibrate.
std::optional<Place> place_of(const BundleProblem& problem, std::size_t ball, std::vector<bool> out,
                              const Eigen::Matrix3d& file_covariance) {
  out[ball] = false;
  BundleOptions options;
  options.fixed_centres = true;
  options.free_centre = ball;
  const auto fit = adjust(without(problem, out), options);
  if (!fit) return std::nullopt;
  const double inflation = fit->dof > 0 ? std::max(1.0, fit->chi2 / fit->dof) : 1;
  Place place{fit->centres[ball] - problem.centres[ball], inflation * fit->covariance_mm2 + file_covariance,
              0, 0, shows_move(problem, fit->views, ball)};
  place.chi2 = geometry::squared_distance(place.off, place.covariance);
  for (const auto& [gap, image] : residuals_of(problem, fit->views, ball, fit->centres[ball]))
    place.gap_px = std::max(place.gap_px, gap);
  return place;
}

/// Balls that are off, and those whose images are of something else, are taken out one by one, the farthest
/// first, so that they do not disturb the others. `kept_though_moved`: one that contradicts the others, which
/// are too few to tell it from them.
std::vector<std::optional<Place>> places_of(const BundleProblem& problem, const AdjustedViews& found,
                                            const std::vector<Eigen::Matrix3d>& covariances,
                                            std::vector<bool>& out,
                                            std::optional<std::size_t>& kept_though_moved, unsigned threads) {
  const std::size_t n = problem.centres.size();
  std::vector<std::optional<Place>> places(n);
  const auto contradiction = [&](std::size_t ball) {
    const Place& place = *places[ball];
    return std::pair(place.gap_px > largest_gap_px ? place.gap_px : 0.0,
                     place.is_moved && place.chi2 > chi2_limit(n) ? place.chi2 : 0.0);
  };
  for (std::size_t round = 0; round < n; ++round) {
    parallel_for(n, threads, [&](std::size_t ball) {
      const Eigen::Matrix3d of_file =
          covariances.empty() ? Eigen::Matrix3d::Zero() : covariances[found.ball_of_nominal[ball]];
      places[ball] = place_of(problem, ball, out, of_file);
    });
    std::optional<std::size_t> worst;
    for (std::size_t ball = 0; ball < n; ++ball)
      if (!out[ball] && places[ball] && contradiction(ball) > std::pair(0.0, 0.0) &&
          (!worst || contradiction(ball) > contradiction(*worst)))
        worst = ball;
    if (!worst) break;
    if (n - std::size_t(std::ranges::count(out, true)) <= least_kept) {
      if (places[*worst]->is_moved) kept_though_moved = worst;
      break;
    }
    out[*worst] = true;
  }
  return places;
}

std::string listed(const PhantomVerification& result, BallState state) {
  std::string names;
  for (const VerifiedBall& ball : result.balls)
    if (ball.state == state)
      names += fmt::format("{}{}{}", names.empty() ? "" : ", ", ball.label,
                           ball.distance_mm && state == BallState::moved
                               ? fmt::format(" (by {:.2f} mm)", *ball.distance_mm)
                               : "");
  return names;
}

void judge(PhantomVerification& result) {
  std::string message;
  double off = 0;
  for (const auto& [state, verb] : {std::pair{BallState::moved, "moved"},
                                    {BallState::swapped, "of another size"},
                                    {BallState::lost, "lost"}})
    if (const std::string names = listed(result, state); !names.empty())
      message += fmt::format("{}{}: {}", message.empty() ? "" : "; ", verb, names);
  for (const VerifiedBall& ball : result.balls) {
    result.within_mm = std::max({result.within_mm, ball.distance_mm.value_or(0), ball.bound_mm});
    off += ball.state != BallState::as_in_file && ball.state != BallState::not_verified;
  }
  if (!message.empty())
    result.failure = Failure{Reason::calibrator_mismatch,
                             "the phantom is not as in its file: " + message +
                                 "; measure it again with `helicarm phantom measure`",
                             {},
                             {{"balls_off", off}}};
}

/// A ball in whose place one of another size is seen, in two views or more.
bool is_swapped(const phantom::CalibratorBall& ball, const phantom::Calibrator& file,
                const std::vector<pipeline::RectifiedView>& detected,
                const std::vector<geometry::View>& views, const std::vector<std::size_t>& view_of_case) {
  constexpr double reach_px = 6, alike = 0.1;
  int seen = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const pipeline::RectifiedView& image = detected[view_of_case[v]];
    const rectification::DistortionMap& map = image.rectification.map;
    const Eigen::Vector2d uv = views[v].project(ball.centre_in_calibrator);
    const double px_per_mm = std::abs(views[v].intrinsics.fy) / views[v].depth(ball.centre_in_calibrator);
    for (const detection::Dot& dot : fiducials::ball_candidates(image.dots, image.rectification)) {
      const auto at = map.rectified_from_raw(dot.centre_px);
      if (!at || (*at - uv).norm() > reach_px) continue;
      const double raw_px_per_mm = px_per_mm * std::sqrt(std::abs(map.jacobian(*at).determinant()));
      seen += std::ranges::any_of(file.balls, [&](const phantom::CalibratorBall& other) {
        return other.diameter_mm != ball.diameter_mm &&
               std::abs(std::log(2 * dot.radius_px / raw_px_per_mm / other.diameter_mm)) < alike;
      });
    }
  }
  return seen >= 2;
}

/// Whether it is missing: in two views or more its place is in the image and free.
bool is_missing(const phantom::CalibratorBall& ball, const std::vector<pipeline::RectifiedView>& detected,
                const std::vector<geometry::View>& views, const std::vector<std::size_t>& view_of_case) {
  int empty = 0;
  for (std::size_t v = 0; v < views.size(); ++v)
    empty += pipeline::is_absent(ball, detected[view_of_case[v]], views[v]);
  return empty >= 2;
}

/// A ball of which no two images agree.
BallState unlocated(const phantom::CalibratorBall& ball, const phantom::Calibrator& file,
                    const std::vector<pipeline::RectifiedView>& detected,
                    const std::vector<geometry::View>& views, const std::vector<std::size_t>& view_of_case) {
  if (is_swapped(ball, file, detected, views, view_of_case)) return BallState::swapped;
  return is_missing(ball, detected, views, view_of_case) ? BallState::lost : BallState::not_verified;
}

Warning not_verified(const VerifiedBall& ball) {
  if (!ball.distance_mm)
    return {Reason::not_seen, fmt::format("{} is not seen in two images: not verified", ball.label), {}, {}};
  return {
      Reason::residual_too_large,
      fmt::format("{} appears {:.3f} mm off in one view alone, as a partly hidden ball does: not verified",
                  ball.label, *ball.distance_mm),
      {},
      {{"distance_mm", *ball.distance_mm}}};
}

/// The file's scale, by the diameters of the balls' images and the distance from the source.
void compare_scale(const AdjustedViews& found, const pipeline::Case& the_case,
                   const std::vector<pipeline::RectifiedView>& detected, PhantomVerification& result) {
  constexpr double warned_sigmas = 3, refused_sigmas = 10;  // as a run's
  const auto evidence_of = [](const DiameterScale& scale) {
    return pipeline::ScaleEvidence{1 / scale.factor - 1, scale.sigma};
  };
  result.scale = evidence_of(diameter_scale(found));
  if (const auto by_tag = depth_limits(found, detected).by_tag)
    result.scale = pipeline::combined(result.scale, evidence_of(*by_tag));
  const double sigma = std::hypot(result.scale.sigma, the_case.calibrator.scale_sigma);
  const double excess = std::abs(result.scale.excess);
  if (excess <= warned_sigmas * sigma) return;
  Failure disagreement{
      Reason::scale_disagrees,
      fmt::format(
          "the balls' diameters imply that the phantom is {:.1f} % {} than in its file (+-{:.1f} %): check "
          "coordinates, diameters and pixel size, or measure it again with `helicarm phantom measure`",
          100 * excess, result.scale.excess > 0 ? "smaller" : "larger", 100 * sigma),
      {},
      {{"file_over_true", 1 + result.scale.excess}, {"sigma", sigma}}};
  if (excess > refused_sigmas * sigma && !result.failure)
    result.failure = std::move(disagreement);
  else
    result.warnings.push_back(std::move(disagreement));
}

/// A longest distance in the file, to be compared by caliper.
Warning scale_note(const phantom::Calibrator& file, const pipeline::ScaleEvidence& scale) {
  std::pair<const phantom::CalibratorBall*, const phantom::CalibratorBall*> pair{&file.balls[0],
                                                                                 &file.balls[0]};
  double longest = 0;
  for (const phantom::CalibratorBall& a : file.balls)
    for (const phantom::CalibratorBall& b : file.balls)
      if (const double mm = (a.centre_in_calibrator - b.centre_in_calibrator).norm(); mm > longest)
        longest = mm, pair = {&a, &b};
  return {
      Reason::scale_unverified,
      fmt::format("the scale of the file is not verified: images show the balls' positions relative to each "
                  "other, not their absolute distances. By the balls' diameters the file is {:.3f} +- {:.3f} "
                  "times as large as the phantom, so that an error below {:.2g} % does not show. Compare a "
                  "distance by caliper: {} to {}, {:.2f} mm between the centres in the file, {:.2f} mm over "
                  "both balls",
                  1 + scale.excess, scale.sigma, 300 * scale.sigma, pair.first->label, pair.second->label,
                  longest, longest + (pair.first->diameter_mm + pair.second->diameter_mm) / 2),
      {},
      {{"file_over_true", 1 + scale.excess}, {"sigma", scale.sigma}, {"distance_mm", longest}}};
}

void describe(const AdjustedViews& found, const pipeline::Case& the_case,
              const std::vector<pipeline::RectifiedView>& detected, unsigned threads,
              PhantomVerification& result) {
  const auto covariances = phantom::ball_covariances(the_case.calibrator);
  BundleProblem problem = with_file_centres(found, the_case.calibrator, covariances);
  std::vector<bool> out(problem.centres.size(), false);
  std::optional<std::size_t> kept_though_moved;
  const auto places = places_of(problem, found, covariances, out, kept_though_moved, threads);
  BundleOptions fixed;
  fixed.fixed_centres = true;
  const auto fit = adjust(without(problem, out), fixed);
  if (!fit) {
    result.failure = fit.error();
    return;
  }
  result.rms_px = fit->rms_px;
  for (std::size_t ball = 0; ball < the_case.calibrator.balls.size(); ++ball) {
    const phantom::CalibratorBall& in_file = the_case.calibrator.balls[ball];
    VerifiedBall verified{in_file.label, {}, 0, BallState::as_in_file, 0};
    const auto at = std::ranges::find(found.ball_of_nominal, ball);
    const std::size_t i = std::size_t(at - found.ball_of_nominal.begin());
    if (at == found.ball_of_nominal.end() || !places[i] || places[i]->gap_px > largest_gap_px) {
      verified.state = unlocated(in_file, the_case.calibrator, detected, fit->views, found.view_of_case);
    } else {
      for (const BundleView& view : problem.views)
        verified.views += int(std::ranges::count(view.images, i, &FiducialImage::fiducial));
      verified.distance_mm = places[i]->off.norm();
      verified.bound_mm = localization::length_at_95(places[i]->covariance);
      // A ball that a farther one had pushed out may fit once that one is out.
      if (places[i]->chi2 > chi2_limit(problem.centres.size()))
        verified.state = out[i] && places[i]->is_moved ? BallState::moved : BallState::not_verified;
    }
    if (verified.state == BallState::not_verified) result.warnings.push_back(not_verified(verified));
    result.balls.push_back(std::move(verified));
  }
  judge(result);
  if (kept_though_moved && !result.failure) {
    const VerifiedBall& ball = result.balls[found.ball_of_nominal[*kept_though_moved]];
    const std::string by = ball.distance_mm ? fmt::format(" (by {:.2f} mm)", *ball.distance_mm) : "";
    result.failure = Failure{
        Reason::calibrator_mismatch,
        fmt::format(
            "a ball is not at its position in the file, most likely {}{}: the others, {}, are too few "
            "to tell which one; measure the phantom again with `helicarm phantom measure`",
            ball.label, by, std::ranges::count(out, false) - 1),
        {},
        {{"distance_mm", ball.distance_mm.value_or(0)}}};
  }
}

}  // namespace

std::string_view word(BallState state) {
  switch (state) {
    case BallState::as_in_file:
      return "as in the file";
    case BallState::moved:
      return "moved";
    case BallState::swapped:
      return "another size";
    case BallState::lost:
      return "lost";
    case BallState::not_verified:
      return "not verified";
  }
  return "";
}

Expected<PhantomVerification> verify_phantom(const pipeline::Case& the_case, unsigned threads) {
  PhantomVerification result;
  result.warnings = the_case.warnings;
  result.calibrator = digest_of(the_case.calibrator);
  const auto refuse = [&](const Failure& failure) -> Expected<PhantomVerification> {
    if (exit_code(failure.reason) == 2) return tl::unexpected<Failure>(failure);
    result.failure = failure;
    return result;
  };
  if (the_case.views.size() < least_views)
    return refuse({Reason::too_few_views,
                   "at least two views are required to verify a phantom",
                   {},
                   {{"views", double(the_case.views.size())}, {"needed", double(least_views)}}});
  pipeline::RunOptions stages;
  stages.threads = threads;
  const auto detected = pipeline::rectified_views(the_case, stages);
  if (!detected) return refuse(detected.error().failure);
  const auto found =
      adjusted_views(*detected, the_case, KnownCentres::file, least_views, threads, result.warnings);
  if (!found) {
    Failure failure = found.error();
    if (failure.reason == Reason::too_few_fiducials)
      failure.message +=
          ": balls may be hidden, several may be off the calibrator file's positions, or one by more than a "
          "millimetre; `helicarm run` names a displaced ball, `helicarm phantom measure` measures all of "
          "them";
    return refuse(failure);
  }
  if (const auto handed = check_handedness(*found, the_case, *detected); !handed)
    return refuse(handed.error());
  std::erase_if(result.warnings, [](const Warning& w) { return w.reason == Reason::not_seen; });
  describe(*found, the_case, *detected, threads, result);
  compare_scale(*found, the_case, *detected, result);
  result.notes = handedness_notes(*found);
  if (!result.balls.empty()) result.notes.push_back(scale_note(the_case.calibrator, result.scale));
  return result;
}

Json to_json(const PhantomVerification& v) {
  Json json = {{"format", "helicarm-phantom-verification/1"},
               {"status", v.failure ? "refused" : "ok"},
               {"failure", v.failure ? pipeline::to_json(*v.failure) : Json(nullptr)},
               {"warnings", Json::array()},
               {"notes", pipeline::json_list_of(v.notes)},
               {"date", v.date},
               {"calibrator", v.calibrator},
               {"within_mm", v.balls.empty() ? Json(nullptr) : Json(v.within_mm)},
               {"scale",
                {{"verified", false},
                 {"file_over_true", v.scale.sigma > 0 ? Json(1 + v.scale.excess) : Json(nullptr)},
                 {"relative_sigma", v.scale.sigma > 0 ? Json(v.scale.sigma) : Json(nullptr)}}},
               {"reprojection_rms_px", v.balls.empty() ? Json(nullptr) : Json(v.rms_px)},
               {"balls", Json::array()}};
  for (const Warning& warning : v.warnings) json["warnings"].push_back(pipeline::to_json(warning));
  for (const VerifiedBall& ball : v.balls)
    json["balls"].push_back({{"label", ball.label},
                             {"distance_mm", ball.distance_mm ? Json(*ball.distance_mm) : Json(nullptr)},
                             {"bound_mm", ball.distance_mm ? Json(ball.bound_mm) : Json(nullptr)},
                             {"state", word(ball.state)},
                             {"views", ball.views}});
  return json;
}

}  // namespace helicarm::phantom_calibration
