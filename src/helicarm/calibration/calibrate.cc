// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/calibrate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/calibration/ball_offsets.h"
#include "helicarm/calibration/calibrator_warnings.h"
#include "helicarm/calibration/image_residuals.h"
#include "helicarm/calibration/outliers.h"
#include "helicarm/calibration/view_problem.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"

namespace helicarm::calibration {
namespace {

constexpr std::size_t least_fiducials = 6;
constexpr std::size_t recommended_fiducials = 8;
constexpr double least_rho = 1e-8;         // 1 / mm: a source 100 km away
constexpr double inconsistent_sigmas = 3;  // standard deviations of chi2

tl::unexpected<Failure> in_view(Failure failure, const std::string& view) {
  failure.view = view;
  return tl::unexpected<Failure>(std::move(failure));
}

/// One view's block of a matrix of all views.
auto block_of(Eigen::MatrixXd& joint, std::size_t view) {
  const Eigen::Index at = view_parameters * Eigen::Index(view);
  return joint.block<view_parameters, view_parameters>(at, at);
}

void mark_rejected(std::vector<fiducials::Fiducial>& fiducials, std::size_t used_index) {
  const auto is_candidate = [](const fiducials::Fiducial& f) {
    return f.status == fiducials::FiducialStatus::used || f.status == fiducials::FiducialStatus::rejected;
  };
  for (fiducials::Fiducial& f : fiducials)
    if (is_candidate(f) && used_index-- == 0) f.status = fiducials::FiducialStatus::rejected;
}

/// Residuals and figures of a view, calibrated by either method. Refuses `residual_too_large`.
Expected<CalibratedView> described(const std::string& name, const geometry::View& view,
                                   std::vector<fiducials::Fiducial>& fiducials,
                                   const CalibrationOptions& options) {
  const auto pairs = pairs_of(fiducials);
  const auto condition = geometry::dlt_condition(pairs);
  if (!condition) return in_view(condition.error(), name);
  CalibratedView result{name, view, geometry::factors_from_projection(view.projection())};
  result.condition = *condition;
  result.reprojection_rms_px = geometry::reprojection_rms(view, pairs);
  double largest_sigma = 0;
  for (fiducials::Fiducial& f : fiducials) {
    if (f.status != fiducials::FiducialStatus::used && f.status != fiducials::FiducialStatus::rejected)
      continue;
    f.residual_px = (f.uv - view.project(f.centre_in_calibrator)).norm();
    if (f.status != fiducials::FiducialStatus::used) continue;
    largest_sigma = std::max(largest_sigma, f.sigma_px);
    if (f.sigma_px > 0) result.chi2 += std::pow(f.residual_px / f.sigma_px, 2);
  }
  const double limit = std::max(options.largest_rms_px, 3 * largest_sigma);
  if (!(result.reprojection_rms_px <= limit))
    return in_view(
        {Reason::residual_too_large,
         fmt::format(
             "reprojection error {:.3g} px rms exceeds {:.3g} px: labels, calibrator or rectification "
             "are wrong",
             result.reprojection_rms_px, limit),
         {},
         {{"reprojection_rms_px", result.reprojection_rms_px}, {"limit_px", limit}}},
        name);
  return result;
}

void warn_of_few_fiducials(CalibrationResult& result) {
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const double n = double(pairs_of(result.fiducials[i]).size());
    if (n < recommended_fiducials)
      result.warnings.push_back(
          {Reason::few_fiducials,
           fmt::format("{} fiducials are used, at least {} are recommended", n, recommended_fiducials),
           result.views[i].name,
           {{"n", n}}});
  }
}

void inflate_if_inconsistent(CalibrationResult& result) {
  if (result.dof < 1 || chi2_excess(result.chi2, result.dof) < inconsistent_sigmas) return;
  result.variance_scale = result.chi2 / result.dof;
  result.joint_covariance *= result.variance_scale;
  for (CalibratedView& view : result.views) view.covariance *= result.variance_scale;
  result.warnings.push_back(
      {Reason::residual_too_large,
       fmt::format("the fiducials' residuals are {:.2g} times the noise model: all covariances are inflated",
                   std::sqrt(result.variance_scale)),
       {},
       {{"chi2", result.chi2}, {"dof", double(result.dof)}}});
}

/// A calibrator scaled by 1 + s about the fiducials' mean c gives the same images if all distances are
/// scaled, too: d t = s (t + R c) in every view. s is one number, common to all views and points.
void add_scale_error(CalibrationResult& result, double scale_sigma) {
  if (scale_sigma == 0) return;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const std::vector<fiducials::Fiducial>& balls = result.fiducials.front();
  for (const fiducials::Fiducial& ball : balls) mean += ball.centre_in_calibrator / double(balls.size());
  constexpr Eigen::Index translation = 7;  // index among view_parameters
  Eigen::VectorXd by_scale = Eigen::VectorXd::Zero(result.joint_covariance.rows());
  for (std::size_t i = 0; i < result.views.size(); ++i)
    by_scale.segment<3>(view_parameters * Eigen::Index(i) + translation) =
        result.views[i].view.camera_from_world * mean;
  result.joint_covariance += scale_sigma * scale_sigma * by_scale * by_scale.transpose();
  for (std::size_t i = 0; i < result.views.size(); ++i)
    result.views[i].covariance = block_of(result.joint_covariance, i);
}

/// The fit without outliers; with offsets of the fiducials where only these explain the residuals.
Expected<CleanFit> clean_fit(const std::vector<ViewProblem>& problems, const CalibrationOptions& options,
                             double& found_tolerance_mm) {
  auto clean =
      refine_without_outliers(problems, options.common, options.rejection_probability, least_fiducials);
  const bool as_in_file =
      options.common.ball_covariance_mm2.empty() && options.common.joint_ball_covariance_mm2.size() == 0;
  if (!clean || !as_in_file || problems.size() < 2 || options.rejection_probability <= 0 ||
      clean->fit.dof < 1)
    return clean;
  if (chi2_excess(clean->fit.chi2, clean->fit.dof) < inconsistent_sigmas && !rejects_many(*clean, problems))
    return clean;
  auto offsets = fit_ball_offsets(problems, options.common, options.rejection_probability, least_fiducials);
  if (!offsets) return clean;
  found_tolerance_mm = offsets->tolerance_mm;
  return std::move(offsets->clean);
}

/// The prior by the unit errors of the fit in place of those of the fiducials' coordinates.
CalibrationOptions along(const Eigen::MatrixXd& directions, CalibrationOptions options) {
  Eigen::Matrix3Xd& by_ball_errors = options.common.c_arm.by_ball_errors;
  if (by_ball_errors.cols() == directions.rows())
    by_ball_errors = (by_ball_errors * directions).eval();
  else
    by_ball_errors.resize(3, 0);
  return options;
}

/// A failed joint fit has no view: reports the view whose start does not fit its own fiducials, if any.
tl::unexpected<Failure> with_view(const std::vector<ViewFiducials>& views,
                                  const std::vector<ViewProblem>& problems, const Failure& failure,
                                  const CalibrationOptions& options) {
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto fiducials = views[i].fiducials;
    const auto start = described(views[i].name, uncentred(problems[i].start), fiducials, options);
    if (!start) return tl::unexpected<Failure>(start.error());
  }
  return tl::unexpected<Failure>(failure);
}

/// Few fiducials that agree with the other views do not constrain theirs: not the calibrator's shape is the
/// cause, but what made the others disagree.
tl::unexpected<Failure> after_rejection(const Failure& failure,
                                        const std::vector<fiducials::Fiducial>& fiducials) {
  const auto count = [&](fiducials::FiducialStatus status) {
    return std::ranges::count(fiducials, status, &fiducials::Fiducial::status);
  };
  const auto rejected = count(fiducials::FiducialStatus::rejected);
  if (failure.reason != Reason::coplanar_fiducials || rejected == 0) return tl::unexpected<Failure>(failure);
  const auto all = rejected + count(fiducials::FiducialStatus::used);
  return in_view(
      {Reason::calibrator_mismatch,
       fmt::format("{} of {} fiducials do not agree with the other views and the calibrator's file", rejected,
                   all),
       {},
       {{"rejected", double(rejected)}, {"n", double(all)}}},
      failure.view);
}

}  // namespace

Expected<CalibrationResult> calibrate(const std::vector<ViewFiducials>& views,
                                      const CalibrationOptions& options) {
  std::vector<ViewProblem> problems;
  CalibrationResult result;
  const OffsetRoots roots = offset_roots(options.common);
  const Eigen::MatrixXd directions = roots.directions();
  for (const ViewFiducials& view : views) {
    auto problem = problem_of(view, roots);
    if (!problem) return in_view(problem.error(), view.name);
    problems.push_back(*std::move(problem));
    result.fiducials.push_back(view.fiducials);
  }
  const auto clean = clean_fit(problems, along(directions, options), result.found_tolerance_mm);
  if (!clean) return with_view(views, problems, clean.error(), options);
  const Refinement& fit = clean->fit;
  result.chi2 = fit.chi2;
  result.dof = fit.dof;
  result.joint_covariance = fit.covariance_of_steps();
  result.by_ball_errors.resize(view_parameters * Eigen::Index(views.size()), directions.rows());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto of_view = parameters_by_step(fit.views[i]);
    const auto at = view_parameters * Eigen::Index(i);
    auto rows = result.joint_covariance.middleRows<view_parameters>(at);
    rows = (of_view * rows).eval();
    auto columns = result.joint_covariance.middleCols<view_parameters>(at);
    columns = (columns * of_view.transpose()).eval();
    // A fit follows an error of the data by minus its covariance with that error.
    const Eigen::Index known = std::min(directions.cols(), fit.offsets());
    result.by_ball_errors.middleRows<view_parameters>(at) =
        of_view * fit.steps_by_offsets(i).leftCols(known) * directions.leftCols(known).transpose();
  }
  for (const auto& [view, observation] : clean->removed) mark_rejected(result.fiducials[view], observation);

  result.image_residuals = image_residuals(clean->problems, fit);
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto view = described(views[i].name, uncentred(fit.views[i]), result.fiducials[i], options);
    if (!view) return after_rejection(view.error(), result.fiducials[i]);
    const double rho = fit.views[i].rho;
    if (!(rho > least_rho))
      return in_view(
          {Reason::uncertain,
           fmt::format(
               "the source distance is not observable from these fiducials: its inverse is {:.1g} per mm, "
               "limit {:g}",
               rho, least_rho),
           {},
           {{"per_mm", rho}}},
          views[i].name);
    view->chi2 = 0;
    for (const ImageResidual& r : result.image_residuals[i])
      view->chi2 += r.length_px * r.length_px / (r.sigma_px * r.sigma_px);
    view->dof = int(std::lround(degrees_of_freedom(result.image_residuals[i])));
    view->covariance = block_of(result.joint_covariance, i);
    result.views.push_back(*std::move(view));
  }
  inflate_if_inconsistent(result);
  add_scale_error(result, options.common.scale_sigma);
  warn_of_few_fiducials(result);
  warn_of_strain(result, *clean);
  report_offsets(result, *clean);
  return result;
}

Expected<CalibrationResult> calibrate_paper(const std::vector<ViewFiducials>& views,
                                            const CalibrationOptions& options) {
  CalibrationResult result;
  for (const ViewFiducials& view : views) {
    const auto pairs = pairs_of(view.fiducials);
    const auto dlt = geometry::dlt_least_squares(pairs);
    if (!dlt) return in_view(dlt.error(), view.name);
    result.fiducials.push_back(view.fiducials);
    auto calibrated = described(view.name, dlt->view, result.fiducials.back(), options);
    if (!calibrated) return tl::unexpected<Failure>(calibrated.error());
    calibrated->dlt = dlt->factors;
    calibrated->by_paper = true;
    calibrated->dof = 2 * int(pairs.size()) - 11;
    const double freedom = calibrated->dof / (2.0 * double(pairs.size()));
    std::vector<ImageResidual>& residuals = result.image_residuals.emplace_back();
    for (const fiducials::Fiducial& f : result.fiducials.back())
      if (f.status == fiducials::FiducialStatus::used)  // one weight for all
        residuals.push_back({f.residual_px, 1, freedom * Eigen::Matrix2d::Identity()});
    result.chi2 += calibrated->chi2;
    result.dof += calibrated->dof;
    result.views.push_back(*std::move(calibrated));
  }
  warn_of_few_fiducials(result);
  return result;
}

Expected<void> check_views_apart(std::span<const CalibratedView> views,
                                 const Eigen::Vector3d& point_in_calibrator, double least_deg) {
  double widest_deg = 0;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const geometry::Ray a =
          geometry::ray_through(views[i].view, views[i].view.project(point_in_calibrator));
      const geometry::Ray b =
          geometry::ray_through(views[j].view, views[j].view.project(point_in_calibrator));
      widest_deg = std::max(widest_deg, geometry::angle_between(a, b) * 180 / std::numbers::pi);
    }
  if (widest_deg >= least_deg) return {};
  return fail(
      Reason::views_too_close,
      fmt::format("the views are {:.3g} degrees apart, at least {:g} are needed", widest_deg, least_deg),
      {{"angle_deg", widest_deg}, {"limit_deg", least_deg}});
}

}  // namespace helicarm::calibration
