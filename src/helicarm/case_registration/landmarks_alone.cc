// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/landmarks_alone.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::case_registration {

registration::Registration registered_by_landmarks(const std::string& name,
                                                   const std::vector<registration::Landmark>& used,
                                                   const registration::LandmarkRegistration& found,
                                                   const std::optional<registration::LandmarkFault>& fault,
                                                   const std::optional<MarkupPlan>& plan,
                                                   const std::optional<double>& max_error_mm) {
  registration::Registration result;
  result.name = name;
  result.decision = registration::Decision::accept;
  result.world_from_model = found.world_from_model;
  result.covariance = found.covariance;
  result.centre = found.centre;
  if (fault) {
    Failure failure = fault->failure;
    failure.message = fmt::format("{}: {}", name, failure.message);
    add_finding(result, std::move(failure), true);
  }
  std::vector<Eigen::Vector3d> carried;
  if (plan)
    for (const PlanPoint& point : plan->points) carried.push_back(point.in_model);
  if (auto note = registration::handedness_note(used, found, carried)) {
    note->message = fmt::format("{}: {}", name, note->message);
    result.notes.push_back(*std::move(note));
  }
  double worst = 0;
  for (const Eigen::Vector3d& place : found.places)
    worst = std::max(worst, localization::length_at_95(
                                registration::point_covariance(result.covariance, result.centre, place)));
  const double limit = max_error_mm.value_or(registration::usual_error_mm);
  if (worst <= limit) return result;
  const auto largest = std::ranges::max_element(found.residuals_mm);
  add_finding(
      result,
      {Reason::uncertain,
       fmt::format("{}: a landmark may be off by {:.2f} mm (95 %), limit {:g} mm; the largest residual is "
                   "{:.2f} mm, of \"{}\"",
                   name, worst, limit, *largest,
                   used[std::size_t(largest - found.residuals_mm.begin())].name),
       {},
       {{"error_mm", worst}, {"limit_mm", limit}}},
      max_error_mm.has_value());
  return result;
}

}  // namespace helicarm::case_registration
