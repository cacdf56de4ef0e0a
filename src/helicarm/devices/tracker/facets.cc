// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/facets.h"

#include <algorithm>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/least_squares.h"
#include "helicarm/geometry/pose_step.h"

namespace helicarm::tracker {
namespace {

struct SeenFacet {
  std::string name;
  geometry::RigidTransform calibrator_from_facet;
  geometry::RigidTransform tracker_from_facet;
  PoseCovariance information;
};

std::vector<SeenFacet> match(std::span<const Facet> facets, std::span<const FacetPose> seen,
                             const FacetsOptions& options) {
  std::vector<SeenFacet> matched;
  for (const FacetPose& pose : seen) {
    const auto facet = std::ranges::find(facets, pose.name, &Facet::name);
    if (facet == facets.end())
      throw BadInput(Reason::bad_value, fmt::format("the calibrator has no facet \"{}\"", pose.name));
    if (std::ranges::count(seen, pose.name, &FacetPose::name) > 1)
      throw BadInput(Reason::name_clash, fmt::format("facet \"{}\" is given twice", pose.name));
    PoseCovariance covariance = pose.covariance;
    const double body_mm = std::max(options.body_mm, facet->sigma_mm);
    const double body_rad = std::max(options.body_deg, facet->sigma_deg) * std::numbers::pi / 180;
    covariance.diagonal().head<3>().array() += body_mm * body_mm;
    covariance.diagonal().tail<3>().array() += body_rad * body_rad;
    matched.push_back(
        {pose.name, facet->calibrator_from_facet, pose.tracker_from_facet, geometry::inverse(covariance)});
  }
  return matched;
}

FusedPose fuse(const std::vector<SeenFacet>& seen) {
  const auto linearise = [&](const geometry::RigidTransform& pose) {
    geometry::NormalEquations<6> equations{PoseCovariance::Zero(), geometry::PoseStep::Zero()};
    for (const SeenFacet& facet : seen) {
      const geometry::RigidTransform predicted = pose * facet.calibrator_from_facet;
      const geometry::PoseStep residual = geometry::step_between(predicted, facet.tracker_from_facet);
      PoseCovariance jacobian = PoseCovariance::Identity();
      jacobian.topRightCorner<3, 3>() = -geometry::cross_matrix(predicted.translation - pose.translation);
      equations.information += jacobian.transpose() * facet.information * jacobian;
      equations.gradient += jacobian.transpose() * facet.information * residual;
      equations.chi2 += residual.dot(facet.information * residual);
    }
    return std::optional(equations);
  };
  const auto fit = geometry::fit_least_squares(
      seen[0].tracker_from_facet * seen[0].calibrator_from_facet.inverse(), linearise, geometry::moved);
  if (!fit->converged)
    throw BadInput(Reason::uncertain, "the mean pose of the calibrator's facets does not converge");
  FusedPose fused;
  fused.tracker_from_calibrator = fit->state;
  fused.covariance = geometry::inverse(fit->equations.information);
  fused.chi2 = fit->equations.chi2;
  for (const SeenFacet& facet : seen) fused.used.push_back(facet.name);
  return fused;
}

bool agrees(const FusedPose& fused) {
  return fused.used.size() < 2 ||
         fused.chi2 <= chi2_quantile(6 * static_cast<double>(fused.used.size() - 1), normal_at_999);
}

/// The best fusion without one of the facets.
FusedPose fuse_without_one(const std::vector<SeenFacet>& seen) {
  std::optional<FusedPose> best;
  for (std::size_t out = 0; out < seen.size(); ++out) {
    std::vector<SeenFacet> others = seen;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(out));
    FusedPose fused = fuse(others);
    fused.thrown_out = {seen[out].name};
    if (!best || fused.chi2 < best->chi2) best = std::move(fused);
  }
  return *std::move(best);
}

}  // namespace

Expected<FusedPose> fuse_facets(std::span<const Facet> facets, std::span<const FacetPose> seen,
                                const FacetsOptions& options) {
  return guarded([&] {
    if (seen.empty()) throw BadInput(Reason::no_pose, "no facet of the calibrator is visible");
    const std::vector<SeenFacet> matched = match(facets, seen, options);
    const FusedPose all = fuse(matched);
    if (agrees(all)) return all;
    if (matched.size() > 2)
      if (const FusedPose fewer = fuse_without_one(matched); agrees(fewer)) return fewer;
    throw BadInput(
        {Reason::residual_too_large,
         fmt::format("poses of {} facets of the calibrator are inconsistent: chi2 {:.4g}, limit {:.4g}",
                     seen.size(), all.chi2,
                     chi2_quantile(6 * static_cast<double>(seen.size() - 1), normal_at_999)),
         {},
         {{"chi2", all.chi2}, {"facets", static_cast<double>(seen.size())}}});
  });
}

}  // namespace helicarm::tracker
