// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/landmark_picks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/case_registration/plan.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using registration::RegistrationView;

constexpr double missing_chi2 = 9;     // per degree of freedom
constexpr double exchanged_ratio = 9;  // of the names' chi-square to that of exchanged ones

/// A landmark and its rays.
struct PickedRays {
  std::string name;
  Vector3d in_model;
  std::vector<std::size_t> views;
  std::vector<geometry::RayObservation> rays;
  std::vector<double> sigmas;

  Expected<geometry::Intersection> crossing() const {
    const auto n = 2 * Eigen::Index(rays.size());
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t i = 0; i < rays.size(); ++i)
      covariance.diagonal().segment<2>(2 * Eigen::Index(i)).setConstant(sigmas[i] * sigmas[i]);
    return geometry::intersect(rays, covariance);
  }
  double dof() const { return 2 * double(rays.size()) - 3; }
};

PickedRays rays_of(std::string name, const Vector3d& in_model, const pipeline::Case& the_case,
                   const LoadedViews& loaded, const std::vector<RegistrationView>& views) {
  PickedRays picked{std::move(name), in_model, {}, {}, {}};
  for (const pipeline::Pick& pick : the_case.picks) {
    if (pick.name != picked.name) continue;
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (views[i].name != pick.view) continue;
      const auto at = loaded.maps[i] ? rectification::rectified_in_image(*loaded.maps[i], pick.uv_raw)
                                     : std::optional(pick.uv_raw);
      if (!at)
        throw BadInput(Reason::bad_value, fmt::format("picks: \"{}\" lies outside {}", pick.name, pick.view));
      picked.views.push_back(i);
      picked.rays.push_back({views[i].view, *at});
      picked.sigmas.push_back(pick.sigma_px.value_or(0.5));
    }
  }
  return picked;
}

/// The picks with two names exchanged in one view.
std::pair<PickedRays, PickedRays> exchanged_in(std::size_t view, PickedRays a, PickedRays b) {
  const auto ray = [&](PickedRays& of) {
    const auto at = std::ranges::find(of.views, view);
    return at == of.views.end() ? nullptr : &of.rays[std::size_t(at - of.views.begin())];
  };
  auto *in_a = ray(a), *in_b = ray(b);
  if (in_a && in_b) std::swap(in_a->pixel, in_b->pixel);
  return {std::move(a), std::move(b)};
}

/// Refuses names that are exchanged in one view: their rays miss each other.
void check_exchange(const std::vector<PickedRays>& all, const std::vector<RegistrationView>& views,
                    const std::string& model) {
  const auto chi2_of = [](const PickedRays& a, const PickedRays& b) -> std::optional<double> {
    const auto first = a.crossing(), second = b.crossing();
    if (!first || !second) return std::nullopt;
    return first->chi2 + second->chi2;
  };
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const auto now = chi2_of(all[j], all[i]);
      const double dof = all[i].dof() + all[j].dof();
      if (!now || *now < missing_chi2 * dof) continue;
      std::string where;  // of two views either
      double gap_mm = 0;
      for (std::size_t view = 0; view < views.size(); ++view) {
        const auto [a, b] = exchanged_in(view, all[j], all[i]);
        const auto then = chi2_of(a, b);
        if (!then || *now < exchanged_ratio * std::max(*then, dof)) continue;
        where += fmt::format("{}{}", where.empty() ? "" : " or ", views[view].name);
        gap_mm = std::max(a.crossing()->ray_gap_mm, b.crossing()->ray_gap_mm);
      }
      if (where.empty()) continue;
      const double gap_a = all[j].crossing()->ray_gap_mm, gap_b = all[i].crossing()->ray_gap_mm;
      throw BadInput(Failure{
          Reason::residual_too_large,
          fmt::format(
              "models: \"{}\": the rays of the landmarks \"{}\" and \"{}\" miss each other by {:.1f} "
              "and {:.1f} mm, and meet within {:.1f} mm with their picks exchanged in {}: correct the "
              "picks' names",
              model, all[j].name, all[i].name, gap_a, gap_b, gap_mm, where),
          {},
          {{"ray_gap_mm", std::max(gap_a, gap_b)}, {"exchanged_ray_gap_mm", gap_mm}}});
    }
}

}  // namespace

namespace {

/// d where the rays meet (mm) / d the parameters of all views, 3 x 11 n.
Eigen::MatrixXd by_cameras(const geometry::Intersection& crossing, const PickedRays& picked,
                           std::size_t views) {
  constexpr Eigen::Index each = calibration::view_parameters;
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(3, each * Eigen::Index(views));
  for (std::size_t i = 0; i < picked.rays.size(); ++i)
    slope.middleCols<each>(each * Eigen::Index(picked.views[i])) -=
        crossing.by_pixels.middleCols<2>(2 * Eigen::Index(i)) *
        calibration::pixel_by_parameters(picked.rays[i].view, crossing.point);
  return slope;
}

}  // namespace

std::vector<registration::Landmark> picked_landmarks(const pipeline::CaseModel& case_model,
                                                     const pipeline::Case& the_case,
                                                     const LoadedViews& loaded,
                                                     const std::vector<RegistrationView>& views) {
  std::string missing;
  std::vector<PickedRays> picked;
  for (const auto& [name, in_model] : start_landmarks(case_model)) {
    PickedRays rays = rays_of(name, in_model, the_case, loaded, views);
    if (rays.rays.size() >= 2)
      picked.push_back(std::move(rays));
    else
      missing += fmt::format("{}\"{}\" (in {} views)", missing.empty() ? "" : ", ", name, rays.rays.size());
  }
  if (picked.size() < registration::least_landmarks)
    throw BadInput(Reason::bad_value,
                   fmt::format("models: \"{}\": {}: {} of its landmarks are picked in two views, at least {} "
                               "are required; not picked so: {}",
                               case_model.name, source_of_landmarks(case_model), picked.size(),
                               registration::least_landmarks, missing.empty() ? "none" : missing));
  check_exchange(picked, views, case_model.name);
  std::vector<registration::Landmark> landmarks;
  for (const PickedRays& rays : picked) {
    const auto crossing = value_or_throw(rays.crossing());
    landmarks.push_back({rays.name, rays.in_model, crossing.point,
                         std::max(1.0, crossing.chi2 / rays.dof()) * crossing.covariance,
                         by_cameras(crossing, rays, views.size())});
  }
  return landmarks;
}

}  // namespace helicarm::case_registration
