// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/solve_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/geometry/absolute_pose.h"

namespace helicarm::calibration {
namespace {

constexpr std::array<std::pair<std::string_view, SolveMethod>, 3> words{
    {{"ml", SolveMethod::most_likely}, {"dlt", SolveMethod::dlt}, {"homogeneous", SolveMethod::homogeneous}}};

struct Solution {
  SolvedView solved;
  double sigmas_exceeded = 1;  ///< residuals over the stated sigmas, where inconsistent
};

Expected<Solution> most_likely(const std::vector<fiducials::Fiducial>& points, bool sigmas_given) {
  CalibrationOptions options;
  options.rejection_probability = 0;
  options.largest_rms_px = std::numeric_limits<double>::infinity();
  return calibrate({{"", points}}, options).map([&](const CalibrationResult& result) {
    const CalibratedView& view = result.views.front();
    const double scale = sigmas_given ? 1 : result.chi2 / result.dof / result.variance_scale;
    return Solution{{view.view, view.dlt, result.joint_covariance * scale, view.condition, 0, {}},
                    sigmas_given ? std::sqrt(result.variance_scale) : 1};
  });
}

Expected<Solution> linear(const std::vector<geometry::PointPair>& pairs, SolveMethod method) {
  const auto found =
      method == SolveMethod::dlt ? geometry::dlt_least_squares(pairs) : geometry::dlt_homogeneous(pairs);
  return found.map([](const geometry::DltResult& dlt) {
    return Solution{{dlt.view, dlt.factors, std::nullopt, dlt.condition, 0, {}}};
  });
}

double residual_px(const SolvedView& solved, const fiducials::Fiducial& point) {
  return (solved.view.project(point.centre_in_calibrator) - point.uv).norm();
}

std::optional<Warning> residual_warning(const Solution& solution,
                                        const std::vector<fiducials::Fiducial>& points) {
  const auto farthest = std::ranges::max_element(
      points, {}, [&](const fiducials::Fiducial& point) { return residual_px(solution.solved, point); });
  const double limit = CalibrationOptions{}.largest_rms_px, rms = solution.solved.reprojection_rms_px;
  const std::string check = fmt::format(
      "check the point with the largest residual ({}); solve rejects no outlier", farthest->label);
  if (rms > limit)
    return Warning{Reason::residual_too_large,
                   fmt::format("{:.3g} px rms, over {:g} px: {}", rms, limit, check),
                   {},
                   {{"rms_px", rms}, {"limit", limit}}};
  if (solution.sigmas_exceeded > 1)
    return Warning{
        Reason::residual_too_large,
        fmt::format("residuals are {:.3g} times the stated sigma_px, and the covariance is inflated: {}",
                    solution.sigmas_exceeded, check),
        {},
        {{"sigmas_exceeded", solution.sigmas_exceeded}}};
  return std::nullopt;
}

}  // namespace

Expected<SolveMethod> solve_method(std::string_view word, const std::string& what) {
  const auto found = std::ranges::find(words, word, &std::pair<std::string_view, SolveMethod>::first);
  if (found == words.end())
    return fail(Reason::usage, fmt::format("{}: \"{}\" is none of: dlt, homogeneous, ml", what, word));
  return found->second;
}

Expected<SolvedView> solve_view(const std::vector<fiducials::Fiducial>& points, SolveMethod method,
                                bool sigmas_given, const PointsOrigin& origin) {
  return guarded([&] {
    std::vector<geometry::PointPair> pairs;
    std::vector<Eigen::Vector3d> places;
    for (const fiducials::Fiducial& point : points) {
      pairs.push_back({point.centre_in_calibrator, point.uv});
      places.push_back(point.centre_in_calibrator);
    }
    Solution solution = value_or_throw(method == SolveMethod::most_likely ? most_likely(points, sigmas_given)
                                                                          : linear(pairs, method));
    SolvedView& solved = solution.solved;
    const double distance_mm = (solved.view.source_in_world() - geometry::mean_of(places)).norm();
    value_or_throw(
        exchange::check_source_distance(distance_mm, "the points' middle", origin.file,
                                        fmt::format("give {} in mm; they look like cm or m", origin.places)));
    solved.reprojection_rms_px = geometry::reprojection_rms(solved.view, pairs);
    if (auto warning = residual_warning(solution, points)) solved.warnings.push_back(*std::move(warning));
    if (auto flipped = exchange::mirrored_or_upwards(solved.view.intrinsics))
      solved.warnings.push_back(*std::move(flipped));
    return std::move(solved);
  });
}

}  // namespace helicarm::calibration
