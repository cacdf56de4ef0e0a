// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/bone_checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/guidance/tunnel.h"

namespace helicarm::case_registration {
namespace {

using registration::BoneCheck;

/// A breach that neither the nearest place of the wall nor of the end shows.
std::optional<guidance::WallPlace> surer_elsewhere(const BoneCheck& check) {
  BoneCheck nearest = check;
  nearest.wall.clear();
  nearest.ahead.clear();
  return check.is_breach() && !nearest.is_breach() ? check.least_sure() : std::nullopt;
}

/// Adds the registration's error across the place's surface.
void add_registration(guidance::WallPlace& place, const registration::Registration& result) {
  const Eigen::Vector3d outward = result.world_from_model.rotation * place.outward;
  const Eigen::Matrix3d covariance =
      registration::point_covariance(result, result.world_from_model * place.on_axis);
  place.drilled_sigma_mm = std::sqrt(place.sigma_mm * place.sigma_mm + outward.dot(covariance * outward));
}

std::map<std::string, double> figures_of(const BoneCheck& check) {
  std::map<std::string, double> figures = {{"diameter_mm", check.diameter_mm.value_or(0)}};
  if (check.bridge_mm) {
    figures["bridge_mm"] = *check.bridge_mm;
    figures["sigma_mm"] = check.drilled_sigma_mm.value_or(0);
    figures["at_mm"] = *check.at_mm;
  }
  if (check.end_mm) figures["end_mm"] = *check.end_mm;
  if (check.is_breach() && check.end_mm) figures["end_sigma_mm"] = check.drilled_end_sigma_mm.value_or(0);
  if (const auto least = surer_elsewhere(check)) {
    figures["least_sure_mm"] = least->distance_mm;
    figures["least_sure_sigma_mm"] = least->drilled_sigma_mm;
    figures["least_sure_at_mm"] = least->at_mm;
  }
  if (check.required_mm) figures["limit_mm"] = *check.required_mm;
  return figures;
}

/// Bridge and bone ahead of the end in words.
std::string places_of(const BoneCheck& check) {
  if (!check.entry) return fmt::format("its line {}", guidance::words(check.no_entry));
  std::string text;
  if (check.bridge_mm)
    text = fmt::format(
        "its wall is {:.2f} mm from the bone's surface (sigma {:.2f} mm with the registration), "
        "{:.1f} mm behind the entry",
        *check.bridge_mm, check.drilled_sigma_mm.value_or(0), *check.at_mm);
  if (check.end_mm)
    text += fmt::format("{}{:.2f} mm of bone are ahead of its end", text.empty() ? "" : "; ", *check.end_mm);
  if (check.end_mm && check.is_breach())
    text += fmt::format(" (sigma {:.2f} mm)", check.drilled_end_sigma_mm.value_or(0));
  if (const auto least = surer_elsewhere(check))
    text += fmt::format(
        "; it is least sure {:.1f} mm behind the entry, {:.2f} mm from the surface (sigma {:.2f} mm)",
        least->at_mm, least->distance_mm, least->drilled_sigma_mm);
  return text;
}

Failure finding(Reason reason, const std::string& model, const MarkupLine& tunnel, const BoneCheck& check,
                const std::string& end) {
  return {reason,
          fmt::format("{}: tunnel \"{}\" of {:g} mm: {}{}", model, tunnel.name, check.diameter_mm.value_or(0),
                      places_of(check), end),
          {},
          figures_of(check)};
}

}  // namespace

std::vector<std::optional<BoneCheck>> bone_checks(const MarkupPlan& plan,
                                                  const registration::BoneSurface* bone) {
  std::vector<std::optional<BoneCheck>> checks(plan.tunnels.size());
  if (!bone) return checks;
  for (std::size_t i = 0; i < checks.size(); ++i) {
    const MarkupLine& tunnel = plan.tunnels[i];
    registration::BoneTunnel line{plan.points[tunnel.start].in_model, plan.points[tunnel.end].in_model,
                                  tunnel.diameter_mm};
    if (tunnel.enters_at_end) std::swap(line.start, line.end);
    if (!((line.end - line.start).norm() >= guidance::shortest_tunnel_mm)) continue;  // refused as a tunnel
    checks[i] = check_tunnel(*bone, line);
    if (tunnel.diameter_mm) checks[i]->required_mm = tunnel.bridge_mm;
  }
  for (std::size_t i = 0; i < checks.size(); ++i)
    for (std::size_t k = 0; k < checks.size(); ++k)
      if (i != k && checks[i] && checks[k] && checks[i]->entry && checks[k]->entry &&
          checks[i]->diameter_mm && checks[k]->diameter_mm)
        checks[i]->to_tunnels.push_back(
            {plan.tunnels[k].name, registration::tunnel_distance_mm(*checks[i], *checks[k])});
  return checks;
}

void judge_tunnels(const MarkupPlan& plan, std::vector<std::optional<BoneCheck>>& checks,
                   registration::Registration& result) {
  for (std::size_t i = 0; i < checks.size(); ++i) {
    if (!checks[i] || !checks[i]->diameter_mm) continue;
    BoneCheck& check = *checks[i];
    const MarkupLine& tunnel = plan.tunnels[i];
    if (result.is_determined()) {
      const auto nearest = [&](std::vector<guidance::WallPlace>& places) {
        for (guidance::WallPlace& place : places) add_registration(place, result);
        return std::ranges::min_element(places, {}, &guidance::WallPlace::distance_mm);
      };
      if (const auto least = nearest(check.wall); least != check.wall.end())
        check.drilled_sigma_mm = least->drilled_sigma_mm;
      if (const auto least = nearest(check.ahead); least != check.ahead.end())
        check.drilled_end_sigma_mm = least->drilled_sigma_mm;
    }
    if (check.is_breach())
      add_finding(
          result,
          finding(Reason::tunnel_breach, result.name, tunnel, check,
                  check.entry ? ": that it leaves the bone is not excluded (95 %); move the line or choose a "
                                "smaller diameter"
                              : "; move the line"),
          true);
    else if (check.is_thin())
      add_finding(result,
                  finding(Reason::bridge_thin, result.name, tunnel, check,
                          fmt::format(", below the {:g} mm asked for", check.required_mm.value_or(0))),
                  false);
    for (const registration::TunnelDistance& other : check.to_tunnels)
      if (check.required_mm && other.distance_mm < *check.required_mm)
        add_finding(
            result,
            {Reason::bridge_thin,
             fmt::format("{}: tunnel \"{}\": its wall is {:.2f} mm from that of tunnel \"{}\"{}, below "
                         "the {:g} mm asked for",
                         result.name, tunnel.name, other.distance_mm, other.tunnel,
                         other.distance_mm < 0 ? " (they meet)" : "", *check.required_mm),
             {},
             {{"distance_mm", other.distance_mm}, {"limit_mm", *check.required_mm}}},
            false);
  }
}

}  // namespace helicarm::case_registration
