// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/plan_errors.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/localization/error_bound.h"

namespace helicarm::case_registration {

std::optional<PlannedError> largest_error(const std::vector<RegisteredPoint>& points) {
  std::optional<PlannedError> largest;
  const auto take = [&](const std::string& point, const std::string& frame,
                        const Eigen::Matrix3d& covariance) {
    const double error = localization::length_at_95(covariance);
    if (!largest || error > largest->error_95_mm || std::isnan(error))
      largest = PlannedError{point, frame, error};
  };
  for (const RegisteredPoint& point : points) {
    const guidance::PointInFrames& place = point.place;
    take(point.name, "world", place.covariance_in_calibrator);
    for (const auto& [bone, at] : place.in_bones) take(point.name, bone + "'s", at.covariance);
    if (place.in_tool) take(point.name, "tool's", place.in_tool->covariance);
  }
  return largest;
}

void limit_error(const std::optional<PlannedError>& largest, const std::optional<double>& max_error_mm,
                 registration::Registration& result) {
  const double limit = max_error_mm.value_or(registration::usual_error_mm);
  if (!largest || largest->error_95_mm <= limit) return;
  add_finding(
      result,
      {Reason::uncertain,
       fmt::format("{}: the 95 % error of the planned point \"{}\" is {:.3g} mm in the {} frame, over the "
                   "limit of {:g} mm",
                   result.name, largest->point, largest->error_95_mm, largest->frame, limit),
       {},
       {{"error_95_mm", largest->error_95_mm}, {"limit_mm", limit}}},
      max_error_mm.has_value());
}

void judge_explained(const MarkupPlan& plan, registration::Registration& result) {
  if (!result.not_explained) return;
  std::vector<std::string> points, tunnels;
  for (const PlanPoint& point : plan.points)
    if (result.not_explained->may_have(point.in_model)) points.push_back(point.name);
  const auto reaches = [&](const MarkupLine& tunnel, std::size_t end) {
    return result.not_explained->may_have(plan.points[end].in_model, tunnel.diameter_mm.value_or(0) / 2);
  };
  for (const MarkupLine& tunnel : plan.tunnels)
    if (reaches(tunnel, tunnel.start) || reaches(tunnel, tunnel.end)) tunnels.push_back(tunnel.name);
  if (points.empty() && tunnels.empty()) return;
  const bool refuses = !tunnels.empty();
  add_finding(
      result,
      {Reason::wrong_model,
       fmt::format(
           "{}: planned in the part that the pose does not explain, or within {:.0f} mm of it: "
           "{}; their stated errors do not hold. Register that part as a model of its own, with a mask of it",
           result.name, registration::NotExplained::margin_mm, fmt::join(refuses ? tunnels : points, ", ")),
       {},
       {{"points", double(points.size())}, {"tunnels", double(tunnels.size())}}},
      refuses);
}

void add_finding(registration::Registration& result, Failure finding, bool refuses) {
  using registration::Decision;
  if (!refuses)
    result.warnings.push_back(std::move(finding));
  else if (!result.failure)
    result.failure = std::move(finding);
  result.decision = result.failure ? Decision::refuse : std::max(result.decision, Decision::warn);
}

}  // namespace helicarm::case_registration
