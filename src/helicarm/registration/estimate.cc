// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/estimate.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/parallel.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/registration/contour.h"
#include "helicarm/registration/patches.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

double pixel_mm_of(const geometry::View& view, const Vector3d& at) {
  return std::max(1.0, view.depth(at)) / std::abs(view.intrinsics.fy);
}

/// The steepest fall of attenuation lies inside the edge of a round, blurred bone: 0.4 mm in simulated images
/// with a raster of 0.5 mm.
double inward_px(const Model& model, const Raster& raster) { return model.voxel_mm > 0 ? raster.factor : 0; }

/// Score over the views that take part.
double score_of(const Observation& observation, const std::vector<bool>& views) {
  if (views.empty()) return observation.score();
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (views[i]) sum += observation.views[i].score, ++count;
  return count > 0 ? sum / count : 0;
}

RigidEquations equations_of(const Observation& observation, const std::vector<bool>& views) {
  RigidEquations sum;
  for (std::size_t i = 0; i < observation.views.size(); ++i) {
    if (!views.empty() && !views[i]) continue;
    const RigidEquations of_view = rigid_equations(observation.views[i]);
    sum.information += of_view.information;
    sum.gradient += of_view.gradient;
  }
  return sum;
}

}  // namespace

RegistrationProblem::RegistrationProblem(const Model& model, const std::vector<RegistrationView>& views,
                                         unsigned threads)
    : model_(&model), views_(&views), threads_(threads), full_(views.size()) {
  parallel_for(views.size(), threads, [&](std::size_t i) { full_[i] = attenuation_raster(views[i]); });
}

RegistrationProblem::RegistrationProblem(const RegistrationProblem& other, const Model& model)
    : model_(&model), views_(other.views_), threads_(other.threads_), full_(other.full_) {}

double RegistrationProblem::pixel_mm(const Vector3d& at) const {
  double finest = 1e9;
  for (const RegistrationView& view : *views_) finest = std::min(finest, pixel_mm_of(view.view, at));
  return finest;
}

double RegistrationProblem::comparison_px(const Level& level, std::size_t view) const {
  return prepared(level).rasters[view].factor * (level.contour ? contour_spacing : PatchOptions{}.side);
}

void RegistrationProblem::prepare(const Level& level, const Vector3d& near) {
  if (levels_.contains({level.contour, level.spacing_mm})) return;
  Prepared made;
  for (std::size_t i = 0; i < views_->size(); ++i) {
    const double factor = level.spacing_mm / pixel_mm_of((*views_)[i].view, near);
    made.rasters.push_back(coarser(full_[i], std::clamp(static_cast<int>(std::lround(factor)), 1, 64)));
  }
  if (!level.contour) {
    made.density = coarser(model_->density, level.spacing_mm);
    mark_blocks(made.density);
  }
  levels_.emplace(std::pair(level.contour, level.spacing_mm), std::move(made));
}

const RegistrationProblem::Prepared& RegistrationProblem::prepared(const Level& level) const {
  return levels_.at({level.contour, level.spacing_mm});
}

Observation RegistrationProblem::observe(const Level& level, const geometry::RigidTransform& pose,
                                         bool derivatives, unsigned threads,
                                         const std::vector<bool>& which) const {
  const Prepared& made = prepared(level);
  const Vector3d centre = pose * model_->centre;
  Observation observation;
  for (std::size_t i = 0; i < views_->size(); ++i) {
    if (!which.empty() && !which[i]) {
      observation.views.emplace_back();
      continue;
    }
    const geometry::View& view = (*views_)[i].view;
    observation.views.push_back(
        level.contour ? compare_contour(made.rasters[i], view, *model_->surface, pose, centre,
                                        {level.reach, level.sigma_px, inward_px(*model_, made.rasters[i])},
                                        model_->cuts)
                      : compare_patches(made.rasters[i], view, made.density, model_->cuts, pose, centre,
                                        derivatives, threads));
  }
  return observation;
}

RigidEquations rigid_equations(const ViewObservation& view) {
  Information information = Information::Zero();
  Gradient gradient = Gradient::Zero();
  for (const Comparison& comparison : view.comparisons) {
    information += comparison.information;
    gradient += comparison.gradient;
  }
  const double offset = information(edge_offset, edge_offset) + 1 / std::pow(edge_offset_sigma_px, 2);
  const Gradient cross = information.col(edge_offset);
  information -= cross * cross.transpose() / offset;
  gradient -= cross * (gradient[edge_offset] / offset);
  const auto map = affine_from_rigid();
  return {map.transpose() * information.topLeftCorner<12, 12>() * map, map.transpose() * gradient.head<12>()};
}

Estimate refine(const RegistrationProblem& scene, const Level& level, const geometry::RigidTransform& start,
                const RefineOptions& options) {
  const Model& model = scene.model();
  Estimate best{start, scene.observe(level, start, true, options.threads, options.views), 0};
  best.score = score_of(best.observation, options.views);
  double damping = 1e-3;
  const double converged_mm = options.converged * level.spacing_mm;
  constexpr double tolerance = 1e-6;  // of the score: patches enter and leave
  for (int i = 0; i < options.iterations; ++i) {
    RigidEquations equations = equations_of(best.observation, options.views);
    const Vector3d centre = best.pose * model.centre;
    equations.information += options.prior;
    equations.gradient += options.prior * step_about(best.pose, start, centre);
    RigidCovariance damped = equations.information;
    damped.diagonal() *= 1 + damping;
    // Without information along a direction there is no step along it.
    damped.diagonal().array() += 1e-9 * damped.diagonal().maxCoeff() + 1e-30;
    RigidStep step = geometry::solve_spd(damped, equations.gradient).solution;
    if (!step.allFinite()) break;
    const double length = std::hypot(step.tail<3>().norm(), model.radius_mm * step.head<3>().norm());
    const double longest = 4 * (level.contour ? level.reach * level.spacing_mm / 4 : level.spacing_mm);
    if (length > longest) step *= longest / length;
    const auto pose = moved_about(best.pose, centre, step);
    Estimate next{pose, scene.observe(level, pose, true, options.threads, options.views), 0};
    next.score = score_of(next.observation, options.views);
    if (next.score >= best.score - tolerance) {
      best = std::move(next);
      damping = std::max(1e-4, damping / 10);
      if (length < converged_mm) break;
    } else {
      damping *= 10;
      if (damping > 1e3 || length < converged_mm) break;
    }
  }
  return best;
}

}  // namespace helicarm::registration
