// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/register_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <variant>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/registration/causes.h"
#include "helicarm/registration/checks.h"
#include "helicarm/registration/covariance.h"
#include "helicarm/registration/mirror.h"
#include "helicarm/registration/poses_anywhere.h"

namespace helicarm::registration {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using geometry::RigidTransform;

constexpr double same_mm = 1.5;        // between solutions that count as one, before the last level
constexpr double correlation_mm = 12;  // of residuals along a bone's edge
// Bias of a CT's edges in a view, of the finest spacing.
constexpr double edge_shift_sigma = 0.1;
constexpr double edge_growth_sigma = 0.05;
constexpr double lone_growth_sigma = 0.1;  // a single view of a body that a threshold delimits
// Of a surface from a mask, of its voxels: the mask's boundary, and edges in the image that thick and thin
// cortex shift unlike.
constexpr double voxel_edge_sigma = 0.2;
// Of the covariance from the residuals of a surface from a mask: what its outline does not hold (cortex of
// changing thickness) shifts edges over longer ways than residuals show. Without it chi-square of simulated
// wrist bones' poses was up to 30 for 6 degrees of freedom.
constexpr double voxel_residual_inflation = 3;
constexpr double part_shift_mm = 8, part_turn_deg = 10;  // searched for the parts of a model
constexpr double alone_prior_mm = 10;                    // keeps a single view from running along its rays

/// Levels from coarse to fine for this model and these views.
std::vector<SearchStage> stages_for(const RegistrationProblem& scene, const Vector3d& at) {
  const Model& model = scene.model();
  const double pixel = scene.pixel_mm(at);
  if (model.surface) {
    const double coarse = std::clamp(model.radius_mm / 7, 1.5, 5.0);
    return {{{false, coarse}, 16},
            {{false, coarse / 2}, 16},
            {{true, std::max(pixel, coarse / 2.5), 5, 2.0 / pixel * 0.4}, 6},
            {{true, std::max(pixel, 1.0), 5, 0.6 / pixel}, 3},
            {{true, std::max(pixel, 0.5), 5, std::max(1.0, 0.3 / pixel)}, 2}};
  }
  const double fine = std::max(model.resolution_mm, 2 * pixel);
  std::vector<SearchStage> stages = {{{false, fine}, 3, 1.3}};
  constexpr double hopeless_ratio = 1.6;
  const double coarsest = std::max(fine, std::min(5.0, model.radius_mm / 5));
  for (double spacing = 2 * fine; spacing < 1.5 * coarsest; spacing *= 2)
    stages.insert(stages.begin(), {{false, spacing}, stages.size() < 2 ? 8 : 32, hopeless_ratio});
  return stages;
}

/// From poses found anywhere; coarser levels than theirs lead away.
std::vector<SearchStage> stages_from_anywhere(const RegistrationProblem& scene, const Vector3d& at) {
  std::vector<SearchStage> stages = stages_for(scene, at);
  while (stages.size() > 1 && stages.front().level.spacing_mm > level_anywhere(scene.model()).spacing_mm)
    stages.erase(stages.begin());
  // Patches of a surface hardly tell its poses apart: contours do.
  if (scene.model().surface && stages.size() > 1) stages[1].keep = 16;
  return stages;
}

MatrixXd camera_covariance_of(const std::vector<RegistrationView>& views,
                              const RegistrationOptions& options) {
  constexpr Eigen::Index each = calibration::view_parameters;
  if (options.camera_covariance.size() > 0) return options.camera_covariance;
  MatrixXd joint = MatrixXd::Zero(each * Eigen::Index(views.size()), each * Eigen::Index(views.size()));
  for (std::size_t i = 0; i < views.size(); ++i)
    if (views[i].covariance)
      joint.block<each, each>(each * Eigen::Index(i), each * Eigen::Index(i)) = *views[i].covariance;
  return joint;
}

std::vector<double> correlations_px(const std::vector<RegistrationView>& views, const Model& model,
                                    const Vector3d& centre) {
  std::vector<double> lengths;
  for (const RegistrationView& view : views)
    lengths.push_back(std::min(correlation_mm, model.radius_mm / 2) * std::abs(view.view.intrinsics.fy) /
                      view.view.depth(centre));
  return lengths;
}

EdgeSigma edge_sigma_of(const Model& model, double spacing_mm, std::size_t views) {
  const double finest_mm = std::max(spacing_mm, model.resolution_mm);
  const double growth = model.outlined || views > 1 ? edge_growth_sigma : lone_growth_sigma;
  const double of_voxels = voxel_edge_sigma * model.voxel_mm;
  return {std::max(edge_shift_sigma * finest_mm, of_voxels), std::max(growth * finest_mm, of_voxels)};
}

/// Information, in the units of the comparisons' weights, of a prior with this sigma (rms over the model).
RigidCovariance prior_information(const Observation& observation, const ErrorModel& errors, double sigma_mm) {
  const Linearised sum = linearised(observation, {}, errors.correlation_px);
  const double unit = geometry::solve_spd(sum.information, sum.meat).solution.trace() / 6;
  RigidCovariance information = RigidCovariance::Zero();
  information.topLeftCorner<3, 3>().diagonal().setConstant(std::pow(errors.radius_mm / sigma_mm, 2));
  information.bottomRightCorner<3, 3>().diagonal().setConstant(1 / (sigma_mm * sigma_mm));
  return unit * information;
}

/// Each view alone, from the joint solution; none of a single view.
std::vector<OwnSolution> own_solutions(const RegistrationProblem& scene, const ErrorModel& errors,
                                       const Level& level, const Estimate& joint, const Vector3d& centre) {
  const std::size_t n = scene.views().size();
  std::vector<OwnSolution> own;
  if (n < 2) return own;
  for (std::size_t i = 0; i < n; ++i) {
    const RigidCovariance prior = prior_information(joint.observation, errors, alone_prior_mm);
    Problem problem{.views = std::vector<bool>(n, false), .prior = prior};
    problem.views[i] = true;
    const Estimate alone =
        refine(scene, level, joint.pose,
               {.converged = 0.02, .views = problem.views, .prior = prior, .threads = scene.threads()});
    RigidCovariance prior_covariance = RigidCovariance::Zero();
    prior_covariance.topLeftCorner<3, 3>().diagonal().setConstant(
        std::pow(alone_prior_mm / scene.model().radius_mm, 2));
    prior_covariance.bottomRightCorner<3, 3>().diagonal().setConstant(alone_prior_mm * alone_prior_mm);
    const Linearised sum = linearised(alone.observation, problem, errors.correlation_px);
    const RigidCovariance shrink = geometry::solve_spd(sum.information, prior).solution;
    own.push_back({step_about(joint.pose, alone.pose, centre),
                   errors.covariance(alone.observation, centre, problem, sum) +
                       shrink * prior_covariance * shrink.transpose(),
                   errors.scale_sigma * errors.by_size(alone.observation, problem),
                   errors.of_edges(alone.observation, centre, problem)});
  }
  return own;
}

/// How the views' own solutions differ. By this the covariance is inflated, if the edges' bias has
/// `edge_ratio` of its stated variance; the decisions take the stated one.
double compare_views(const RegistrationProblem& scene, const std::vector<OwnSolution>& own, double edge_ratio,
                     Registration& result) {
  if (own.empty()) return 1;
  result.disagreement = disagreement_of(scene.views(), result.centre, own);
  for (std::size_t i = 0; i < own.size(); ++i)
    result.views[i].held_out_mm = result.disagreement->held_out_mm[i];
  std::vector<OwnSolution> by_edge_ratio;
  for (const OwnSolution& each : own) by_edge_ratio.push_back(each.with_edges(edge_ratio));
  return disagreement_of(scene.views(), result.centre, by_edge_ratio).ratio();
}

void describe(const RegistrationProblem& scene, const Level& level, const Estimate& best,
              Registration& result) {
  for (std::size_t i = 0; i < scene.views().size(); ++i) {
    const ViewObservation& seen = best.observation.views[i];
    result.views.push_back({scene.views()[i].name, seen.score,
                            local_shift_px(seen, scene.views()[i].view, result.centre), std::nullopt,
                            int(seen.comparisons.size())});
    RegisteredView& view = result.views.back();
    view.comparison_px = scene.comparison_px(level, i);
    for (const Comparison& each : seen.comparisons)
      view.agreements.push_back({each.pixel, each.agreement, each.weight});
  }
}

Warning depth_from_scale(const RegistrationView& view, const RigidStep& by_size, const Registration& result) {
  const Vector3d ray = (result.centre - view.view.source_in_world()).normalized();
  const double mm_per_percent = 0.01 * std::abs(ray.dot(by_size.tail<3>()));
  return {
      Reason::depth_from_scale,
      fmt::format("{}: in one view size and depth are one: a model that is 1 % too large is placed {:.1f} mm "
                  "too far from the source; its size is taken as known to {:.2g} % (\"scale_sigma\"), which "
                  "is {:.1f} mm of the depth's error",
                  result.name, mm_per_percent, 100 * result.scale_sigma,
                  100 * result.scale_sigma * mm_per_percent),
      view.name,
      {{"mm_per_percent", mm_per_percent}, {"scale_sigma", result.scale_sigma}}};
}

using Poses = std::vector<RigidTransform>;

struct Search {
  std::vector<SearchStage> stages;
  SearchResult found;
};

constexpr double share_of_poses = 0.5;  // of a search anywhere: the poses from which it begins
constexpr double share_of_search = 0.8, share_of_first = 0.6;  // the mirror image, wider searches follow

/// All positions in these orientations, and some poses besides.
struct Everywhere {
  Orientations orientations;
  Poses besides = {};
};

Search searched_anywhere(RegistrationProblem& scene, const Everywhere& everywhere,
                         const SearchOptions& options) {
  const Vector3d middle = middle_of(scene.views());
  Search made{stages_from_anywhere(scene, middle), {}};
  std::size_t starts = 64;
  // Where small bones are most of a model, such as a wrist's, poses beside the right one rank at 100 to 400,
  // and at the first of several levels wrong ones explain more, by any ratio.
  if (everywhere.orientations == Orientations::between && !scene.model().surface && made.stages.size() > 2) {
    starts = 1024;
    made.stages[1] = {made.stages[1].level, 128};
  }
  scene.prepare(level_anywhere(scene.model()), middle);
  std::vector<RigidTransform> poses = poses_anywhere(
      scene, everywhere.orientations, starts, options.interrupt, part_of(options.share, 0, share_of_poses));
  poses.insert(poses.end(), everywhere.besides.begin(), everywhere.besides.end());
  if (poses.empty()) poses.push_back({Eigen::Matrix3d::Identity(), middle - scene.model().centre});
  SearchOptions from_poses = options;
  from_poses.candidates = 0;
  from_poses.share = part_of(options.share, share_of_poses, 1);
  made.found = search(scene, made.stages, poses, from_poses, same_mm);
  return made;
}

/// Whether the errors of every camera are.
bool are_known(const MatrixXd& cameras) {
  constexpr Eigen::Index n = calibration::view_parameters;
  for (Eigen::Index i = 0; i < cameras.rows(); i += n)
    if (cameras.block(i, i, n, n).isZero(0)) return false;
  return true;
}

Search searched_about(RegistrationProblem& scene, const std::vector<RigidTransform>& starts,
                      const SearchOptions& options) {
  Search made{stages_for(scene, starts.front() * scene.model().centre), {}};
  made.found = search(scene, made.stages, starts, options, same_mm);
  return made;
}

Warning found_anywhere(const Registration& before, const Registration& result, double distance_mm) {
  return {Reason::out_of_capture,
          fmt::format("{}: the search about the start was refused ({}); the pose is that of a search over "
                      "every orientation and position, {:.1f} mm from the start",
                      result.name, code(before.failure->reason), distance_mm),
          {},
          {{"distance_mm", distance_mm}}};
}

}  // namespace

Warning cameras_without_covariance(const std::string& name) {
  return {Reason::covariance_missing,
          name +
              ": the cameras come without covariance and are taken as exact: their errors are not in the "
              "covariance; views that helicarm calibrates have one",
          {},
          {}};
}

namespace {

RegistrationOptions with_part(RegistrationOptions options, double begin, double end) {
  options.search.share = part_of(std::move(options.search.share), begin, end);
  return options;
}

/// Which poses are searched: those about some, or all.
using Searched = std::variant<Poses, Everywhere>;

/// `starts` limit where the solution may lie; none: nowhere.
Registration registered(const Model& model, const std::vector<RegistrationView>& views, const Poses& starts,
                        const RegistrationOptions& options, const Searched& searched, bool anywhere) {
  const auto begun = std::chrono::steady_clock::now();
  const auto step = [&](std::string_view name) {
    if (options.search.interrupt) options.search.interrupt();
    if (options.on_step) options.on_step(name);
  };
  step("prepare");
  RegistrationProblem scene(model, views, options.threads);
  const auto* from = std::get_if<Poses>(&searched);
  step(from ? "search" : "search anywhere");
  const SearchOptions of_search = with_part(options, 0, share_of_search).search;
  const auto [stages, found] = from ? searched_about(scene, *from, of_search)
                                    : searched_anywhere(scene, std::get<Everywhere>(searched), of_search);
  const Estimate& best = found.solutions.front();
  Registration result;
  result.name = model.name;
  result.world_from_model = best.pose;
  result.centre = best.pose * model.centre;
  result.score = best.score;
  result.spacing_mm = stages.back().level.spacing_mm;
  result.starts = found.starts;
  result.agree = found.agree;
  result.alternatives = found.alternatives;
  result.anywhere = anywhere;
  if (found.runner_up)
    result.runner_up = {separation(model, best.pose, found.runner_up->pose),
                        (1 - found.runner_up->score) / (1 - found.runner_up_best)};
  describe(scene, stages.back().level, best, result);
  step("errors");
  const MatrixXd cameras = camera_covariance_of(views, options);
  const ErrorModel errors{views,
                          model.radius_mm,
                          cameras_with_motion(cameras, options.motion_sigma_mm),
                          correlations_px(views, model, result.centre),
                          edge_sigma_of(model, result.spacing_mm, views.size()),
                          options.scale_sigma};
  const std::vector<OwnSolution> own = own_solutions(scene, errors, stages.back().level, best, result.centre);
  // The edges of a surface are not those of a CT; a single view shows no strain along its rays.
  const double edge_ratio =
      model.surface || own.empty() ? 1 : edge_variance_ratio(best.observation, errors, result.centre, own);
  result.covariance = errors.covariance(best.observation, result.centre) +
                      (edge_ratio - 1) * errors.of_edges(best.observation, result.centre);
  if (model.voxel_mm > 0)
    result.covariance +=
        (voxel_residual_inflation - 1) * linearised(best.observation, {}, errors.correlation_px).covariance();
  result.deformation = deformation_of(best.observation, errors, result.centre);
  result.covariance *= compare_views(scene, own, edge_ratio, result);
  const RigidStep by_size = errors.by_size(best.observation);
  result.scale_sigma = options.scale_sigma;
  result.by_scale = options.scale_sigma * by_size;
  result.covariance += result.by_scale * result.by_scale.transpose();
  if (views.size() == 1 && by_size.allFinite())
    result.notes.push_back(depth_from_scale(views.front(), by_size, result));
  if (options.search.candidates > 0) {
    step("mirror image");
    result.mirrored_ratio =
        mirrored_cost_ratio(scene, best, stages, with_part(options, share_of_search, 1).search, same_mm);
  }
  RegistrationOptions judged = options;
  judged.camera_covariance = are_known(cameras) ? cameras : MatrixXd();
  if (judged.camera_covariance.size() == 0) result.warnings.push_back(cameras_without_covariance(model.name));
  decide(model, starts, judged, result);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return result;
}

/// A search about a pose reaches farther than the last levels of one over all poses: what these missed lies
/// about the poses that they found, or near to other orientations.
Registration registered_anywhere(const Model& model, const std::vector<RegistrationView>& views,
                                 const Poses& starts, const RegistrationOptions& options) {
  Registration found = registered(model, views, starts, with_part(options, 0, share_of_first),
                                  Everywhere{Orientations::first}, true);
  if (views.size() < 2 || options.search.candidates == 0 || !may_have_missed(found)) return found;
  Poses about{found.world_from_model};
  for (const Alternative& other : found.alternatives) about.push_back(other.world_from_model);
  // What was found goes with the other orientations: a pose almost as good stays known.
  RegistrationOptions rest = with_part(options, share_of_first, 1);
  for (const Searched& searched : {Searched(about), Searched(Everywhere{Orientations::between, about})}) {
    Registration again = registered(model, views, starts, with_part(rest, 0, 0.5), searched, true);
    rest = with_part(rest, 0.5, 1);
    again.seconds += found.seconds;
    if (is_confirmed(model, again)) return again;
    found.seconds = again.seconds;
  }
  return found;
}

Registration registered_or_refused(const Model& model, const std::vector<RegistrationView>& views,
                                   const std::vector<RigidTransform>& starts,
                                   const RegistrationOptions& options) {
  if (starts.empty()) return registered_anywhere(model, views, starts, options);
  const bool may_widen =
      views.size() > 1 && options.search.candidates > 0 && options.search.anywhere_after_refusal;
  Registration result =
      registered(model, views, starts, with_part(options, 0, may_widen ? share_of_first : 1), starts, false);
  if (!may_widen || !may_have_missed(result)) return result;
  Registration wider = registered_anywhere(model, views, starts, with_part(options, share_of_first, 1));
  wider.seconds += result.seconds;
  if (wider.failure) {
    result.seconds = wider.seconds;
    return result;
  }
  double nearest = 1e9;
  for (const RigidTransform& start : starts)
    nearest = std::min(nearest, separation(model, start, wider.world_from_model));
  wider.notes.push_back(found_anywhere(result, wider, nearest));
  return wider;
}

/// A part of a refused model about a pose near it, for `causes_of`. From a shaft's piece a wider search ends
/// elsewhere along the bone.
Registration registered_part(const Model& part, const std::vector<RegistrationView>& views,
                             const RigidTransform& start, const RegistrationOptions& options) {
  RegistrationOptions own = options;
  own.search.shift_mm = part_shift_mm;
  own.search.turn_deg = part_turn_deg;
  own.max_error_mm = std::nullopt;
  own.on_step = {};
  own.search.share = {};
  return registered(part, views, {start}, own, Poses{start}, false);
}

}  // namespace

Registration register_model(const Model& model, const std::vector<RegistrationView>& views,
                            const std::vector<RigidTransform>& starts, const RegistrationOptions& options) {
  Registration result = registered_or_refused(model, views, starts, options);
  if (options.search.share) options.search.share(1);
  const auto begun = std::chrono::steady_clock::now();
  RegisterPart register_part;
  if (options.names_causes && options.search.candidates > 0)
    register_part = [&](const Model& part, const RigidTransform& start) {
      if (options.on_step) options.on_step("a part alone");
      return registered_part(part, views, start, options);
    };
  warn_of_part_not_explained(model, views, register_part, result);
  if (result.failure && options.names_causes) {
    if (options.on_step) options.on_step("causes");
    for (Warning& cause : causes_of(model, views, result, register_part))
      result.notes.push_back(std::move(cause));
  }
  result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return result;
}

}  // namespace helicarm::registration
