// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/measure_phantom.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <numbers>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/phantom/ball_covariance.h"
#include "helicarm/phantom_calibration/adjusted_views.h"
#include "helicarm/phantom_calibration/ball_sizes.h"
#include "helicarm/phantom_calibration/gauge.h"
#include "helicarm/phantom_calibration/phantom_scale.h"
#include "helicarm/phantom_calibration/shown_images.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

constexpr double least_angle_deg = 15;
constexpr double least_move_mm = 0.4;
constexpr double chi2_contradiction = 3;  // standard deviations of chi2 beyond which the sigmas are enlarged

Expected<void> check_apart(const AdjustedViews& found) {
  Vector3d middle = Vector3d::Zero();
  const auto& centres = found.consistent.fit.centres;
  for (const Vector3d& centre : centres) middle += centre / double(centres.size());
  double widest = 0;
  const auto& views = found.consistent.fit.views;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      widest = std::max(widest,
                        geometry::angle_between(geometry::ray_through(views[i], views[i].project(middle)),
                                                geometry::ray_through(views[j], views[j].project(middle))));
  widest *= 180 / std::numbers::pi;
  if (widest >= least_angle_deg) return {};
  return fail(
      Reason::views_too_close,
      fmt::format("the views are at most {:.3g} degrees apart, at least {:g} are needed: take further views",
                  widest, least_angle_deg),
      {{"angle_deg", widest}, {"limit_deg", least_angle_deg}});
}

Expected<void> check_unmoved(const AdjustedViews& found) {
  const auto moved = moved_fiducial(found.consistent, least_move_mm);
  if (!moved) return {};
  std::string views;
  for (const std::size_t v : moved->views)
    views += (views.empty() ? "" : ", ") + found.consistent.problem.views[v].name;
  return fail(
      Reason::phantom_changed,
      fmt::format(
          "{} is displaced by {:.2g} mm in {}: it moved between the views; fix it and take all images again",
          found.labels[moved->fiducial], moved->moved_mm, views),
      {{"moved_mm", moved->moved_mm}, {"views", double(moved->views.size())}});
}

/// Covariance inflation, as the calibration of views does it.
double variance_scale_of(const BundleFit& fit, PhantomResult& result) {
  if (fit.dof < 1 || chi2_excess(fit.chi2, fit.dof) < chi2_contradiction) return 1;
  const double scale = fit.chi2 / fit.dof;
  result.warnings.push_back(
      {Reason::residual_too_large,
       fmt::format("the residuals are {:.2g} times what the noise model allows: all covariances are inflated",
                   std::sqrt(scale)),
       {},
       {{"chi2", fit.chi2}, {"dof", double(fit.dof)}}});
  return scale;
}

/// Carried by a rotation and a translation. The covariance is that after a rigid fit of all points to their
/// true places: the frame of the nominal file has no error of its own.
void carry(ScaledPoints& points, const geometry::RigidTransform& by) {
  const auto n = Eigen::Index(points.centres.size());
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    turn.block<3, 3>(3 * i, 3 * i) = by.rotation;
    points.centres[std::size_t(i)] = by * points.centres[std::size_t(i)];
  }
  points.covariance_mm2 = turn * points.covariance_mm2 * turn.transpose();
  points.covariance_mm2 = in_frame_of(points.covariance_mm2, similarity_motions(points.centres).leftCols<6>(),
                                      Eigen::VectorXd::Ones(n));
}

/// The frame of an unknown phantom: origin at the mean, axes along the principal directions, the longest
/// first, x and y with their largest component positive in the first view's directions, right-handed.
geometry::RigidTransform principal_frame(const std::vector<Vector3d>& centres,
                                         const Eigen::Matrix3d& view_rotation) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& centre : centres) mean += centre / double(centres.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& centre : centres) spread += (centre - mean) * (centre - mean).transpose();
  const Eigen::MatrixXd axes = geometry::symmetric_eigen(spread).vectors;
  Eigen::Matrix3d rotation;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    Vector3d direction = axes.col(2 - axis);
    const Vector3d in_view = view_rotation * direction;
    Eigen::Index largest = 0;
    in_view.cwiseAbs().maxCoeff(&largest);
    if (in_view[largest] < 0) direction = -direction;
    rotation.row(axis) = direction.transpose();
  }
  rotation.row(2) = Vector3d(rotation.row(0)).cross(Vector3d(rotation.row(1))).transpose();
  return {rotation, -(rotation * mean)};
}

/// A nominal file that the measured balls fit as a mirror image only, whatever the views state.
Expected<void> check_not_mirrored(const std::vector<Vector3d>& centres, std::vector<Vector3d> places) {
  constexpr double clearly_better = 3, least_mm = 1;
  const auto off_by = [&] {
    const RobustFit fit = robust_similarity(centres, places, true);
    std::vector<double> off;
    for (std::size_t i = 0; i < places.size(); ++i)
      off.push_back((fit.a_from_b * centres[i] - places[i]).norm());
    return median(std::move(off));
  };
  const double as_is = off_by();
  for (Vector3d& place : places) place.x() = -place.x();
  const double mirrored = off_by();
  if (as_is < least_mm || as_is < clearly_better * mirrored) return {};
  return fail(
      Reason::ambiguous_handedness,
      fmt::format("the balls are {:.3g} mm (median) from the nominal file's positions, and {:.3g} mm from "
                  "those of its mirror image: an axis of the calibrator file has the wrong sign, or "
                  "\"mirrored\" of the views is wrong",
                  as_is, mirrored),
      {{"median_mm", as_is}, {"median_mirrored_mm", mirrored}});
}

Expected<void> set_frame(ScaledPoints& points, const AdjustedViews& found, PhantomResult& result) {
  if (!result.nominal) {
    carry(points, principal_frame(points.centres, found.consistent.fit.views[0].camera_from_world.rotation));
    return {};
  }
  std::vector<Vector3d> places;
  for (const std::size_t ball : found.ball_of_nominal)
    places.push_back(result.nominal->balls[ball].centre_in_calibrator);
  if (auto handed = check_not_mirrored(points.centres, places); !handed) return handed;
  // Weights are found with the scale free, as it may be wrong in the file; the frame is rigid.
  const RobustFit fit = robust_similarity(points.centres, places, true);
  carry(points, similarity_between(points.centres, places, fit.weights, false).a_from_b);
  return {};
}

void describe_views(const AdjustedViews& found, const PhantomOptions& options, PhantomResult& result) {
  const auto left_out = left_out_rms(found.consistent, options.threads);
  const BundleFit& fit = found.consistent.fit;
  for (std::size_t v = 0; v < fit.views.size(); ++v) {
    MeasuredView view;
    view.name = found.consistent.problem.views[v].name;
    view.digest = found.digests[v];
    view.view = fit.views[v];
    view.left_out_rms_px = left_out[v];
    double sum = 0;
    for (std::size_t i = 0; i < fit.residuals_px[v].size(); ++i) {
      view.residuals_px.emplace_back(found.consistent.problem.views[v].images[i].fiducial,
                                     fit.residuals_px[v][i]);
      view.images_px.push_back(found.consistent.problem.views[v].images[i].uv);
      view.sigmas_px.push_back(found.consistent.problem.views[v].images[i].sigma_px);
      sum += fit.residuals_px[v][i].squaredNorm();
    }
    view.rms_px = std::sqrt(sum / double(2 * view.residuals_px.size()));
    result.views.push_back(std::move(view));
  }
}

phantom::JointCovariance joint_covariance(const ScaledPoints& points, const AdjustedViews& found) {
  const auto n = Eigen::Index(found.order.size());
  phantom::JointCovariance joint{{}, Eigen::MatrixXd(3 * n, 3 * n)};
  const auto first_row = [&](Eigen::Index ball) { return 3 * Eigen::Index(found.order[std::size_t(ball)]); };
  for (Eigen::Index row = 0; row < n; ++row) {
    joint.labels.push_back(found.labels[found.order[std::size_t(row)]]);
    for (Eigen::Index column = 0; column < n; ++column)
      joint.mm2.block<3, 3>(3 * row, 3 * column) =
          points.covariance_mm2.block<3, 3>(first_row(row), first_row(column));
  }
  return joint;
}

void describe_balls(const ScaledPoints& points, const AdjustedViews& found, PhantomResult& result) {
  result.calibrator.balls.clear();
  std::vector<std::size_t> rank(found.order.size());
  for (std::size_t k = 0; k < rank.size(); ++k) rank[found.order[k]] = k;
  result.pair.a = rank[result.pair.a];
  result.pair.b = rank[result.pair.b];
  for (MeasuredView& view : result.views)
    for (auto& residual : view.residuals_px) residual.first = rank[residual.first];
  for (const std::size_t i : found.order) {
    const auto at = 3 * Eigen::Index(i);
    MeasuredBall ball{found.labels[i], points.centres[i], points.covariance_mm2.block<3, 3>(at, at), {}, 0};
    if (result.nominal)
      ball.from_nominal =
          points.centres[i] - result.nominal->balls[found.ball_of_nominal[i]].centre_in_calibrator;
    for (const BundleView& view : found.consistent.problem.views)
      ball.views += int(std::ranges::count(view.images, i, &FiducialImage::fiducial));
    result.calibrator.balls.push_back({ball.label, ball.centre, found.diameters_mm[i], ball.covariance_mm2});
    result.balls.push_back(std::move(ball));
  }
  if (found.order.size() <= phantom::most_correlated_balls)
    result.calibrator.joint_covariance = joint_covariance(points, found);
}

void describe_source(const PhantomOptions& options, PhantomResult& result) {
  Json& measured = result.calibrator.measured;
  measured = {{"date", options.date},
              {"by", "helicarm phantom measure " HELICARM_VERSION},
              {"views", Json::array()},
              {"scale", {{"source", result.scale.source}, {"relative_sigma", result.scale.relative_sigma}}},
              {"reprojection_rms_px", result.rms_px}};
  for (const MeasuredView& view : result.views) measured["views"].push_back(view.digest);
  if (options.distances.empty()) return;
  measured["scale"]["distances"] = options.distances.size();
  measured["scale"]["sigma_mm"] = options.distance_sigma_mm;
}

/// Everything after the adjustment; stops at the first refusal.
Expected<void> conclude(AdjustedViews& found, const pipeline::Case& the_case,
                        const std::vector<pipeline::RectifiedView>& detected, const PhantomOptions& options,
                        PhantomResult& result) {
  const BundleFit& fit = found.consistent.fit;
  result.rms_px = fit.rms_px;
  result.chi2 = fit.chi2;
  result.dof = fit.dof;
  describe_views(found, options, result);
  if (result.nominal)
    if (auto handed = check_handedness(found, the_case, detected); !handed) return handed;
  result.notes = handedness_notes(found);
  if (auto apart = check_apart(found); !apart) return apart;
  if (auto unmoved = check_unmoved(found); !unmoved) return unmoved;
  for (const RejectedImage& rejected : found.consistent.rejected)
    result.warnings.push_back(
        {Reason::residual_too_large,
         fmt::format("the image of {} is {:.2g} px from the position predicted by the other views: left out",
                     found.labels[rejected.image.fiducial], rejected.off_px.norm()),
         found.consistent.problem.views[rejected.view].name,
         {{"off_px", rejected.off_px.norm()}}});
  const double variance_scale = variance_scale_of(fit, result);
  if (options.from_scratch)
    if (auto settled =
            settle_sizes(found, detected, the_case, factor_by_hand(found, options), result.warnings);
        !settled)
      return settled;
  auto points = scaled(found, detected, variance_scale * fit.covariance_mm2, options, result);
  if (!points) return tl::unexpected<Failure>(points.error());
  if (auto placed = set_frame(*points, found, result); !placed) return placed;
  result.calibrator.scale_sigma = result.scale.relative_sigma;
  describe_balls(*points, found, result);
  describe_source(options, result);
  return {};
}

/// What the correspondences start from.
Expected<void> check_balls_known(const pipeline::Case& the_case, bool from_scratch) {
  if (from_scratch && the_case.diameters_mm.empty())
    return fail(Reason::bad_value,
                "case.json: \"diameters_mm\": is missing: a measurement from scratch requires the diameters "
                "of the balls, such as [4]");
  if (!from_scratch && the_case.calibrator.balls.empty())
    return fail(Reason::bad_value,
                "case.json: \"calibrator\": is null: name the nominal file, or measure from scratch");
  return {};
}

}  // namespace

std::string today() { return fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr))); }

Expected<PhantomResult> measure_phantom(const pipeline::Case& the_case, const PhantomOptions& options) {
  PhantomResult result;
  result.warnings = the_case.warnings;
  if (!options.from_scratch) result.nominal = the_case.calibrator;
  result.calibrator = result.nominal.value_or(phantom::Calibrator{});
  result.calibrator.tolerance_mm = 0;
  constexpr std::string_view mark = "-measured";
  if (options.from_scratch)
    result.calibrator.name = "measured";
  else if (!result.calibrator.name.ends_with(mark))
    result.calibrator.name += mark;
  const auto refuse = [&](const Failure& failure) -> Expected<PhantomResult> {
    if (exit_code(failure.reason) == 2) return tl::unexpected<Failure>(failure);
    result.failure = failure;
    return result;
  };
  if (const auto known = check_balls_known(the_case, options.from_scratch); !known)
    return refuse(known.error());
  constexpr std::size_t least_views = 3;
  if (the_case.views.size() < least_views)
    return refuse({Reason::too_few_views,
                   fmt::format("{} views: at least {} are required to measure a phantom, 6 to 10 are advised",
                               the_case.views.size(), least_views),
                   {},
                   {{"views", double(the_case.views.size())}, {"needed", double(least_views)}}});
  pipeline::RunOptions stages;
  stages.threads = options.threads;
  for (Warning& warning : sizes_stated_twice(the_case)) result.warnings.push_back(std::move(warning));
  const auto detected = pipeline::rectified_views(the_case, stages, {options.on_stage, options.on_view});
  if (!detected) return refuse(detected.error().failure);
  if (options.on_stage) options.on_stage("adjust");
  const auto begin = std::chrono::steady_clock::now();
  auto found =
      adjusted_views(*detected, the_case, options.from_scratch ? KnownCentres::none : KnownCentres::nominal,
                     least_views, options.threads, result.warnings);
  if (!found) return refuse(found.error());
  const auto concluded = conclude(*found, the_case, *detected, options, result);
  result.solve_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  add_images(*detected, found->view_of_case, options.threads, result);
  if (!concluded) return refuse(concluded.error());
  return result;
}

}  // namespace helicarm::phantom_calibration
