// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/case_plans.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "helicarm/guidance/tunnel.h"

namespace helicarm::case_registration {
namespace {

constexpr double same_place_mm = 1;  // of a landmark and a planned point, as two programs round them

[[noreturn]] void refuse_name(const std::string& name, const std::string& first, const std::string& second) {
  throw BadInput(Reason::name_clash, fmt::format("\"{}\" is {} and {}: one result holds both, so rename one",
                                                 name, first, second));
}

/// Whether the model's landmarks hold the point.
bool is_landmark(const pipeline::CaseModel& model, const PlanPoint& point) {
  const std::vector<PlanPoint> landmarks = start_landmarks(model);
  const auto same = std::ranges::find(landmarks, point.name, &PlanPoint::name);
  return same != landmarks.end() && (same->in_model - point.in_model).norm() < same_place_mm;
}

void check_points(const MarkupPlan& plan, const pipeline::Case& the_case, const pipeline::CaseModel& model) {
  for (const PlanPoint& point : plan.points)
    if (std::ranges::find(the_case.picks, point.name, &pipeline::Pick::name) != the_case.picks.end() &&
        !is_landmark(model, point))
      refuse_name(point.name, fmt::format("a point of \"{}\"'s plan", model.name),
                  "another point, of the picks");
}

/// Gives the lines that the case's tunnels name their names and sizes.
void name_lines(const pipeline::Case& the_case, const pipeline::CaseModel& model, MarkupPlan& plan) {
  const std::vector<MarkupLine> lines = plan.tunnels;
  std::vector<std::string> taken;
  for (const pipeline::ModelLine& tunnel : the_case.model_tunnels) {
    if (tunnel.model != model.name) continue;
    const auto refuse = [&](const std::string& problem) {
      throw BadInput(Reason::bad_value,
                     fmt::format("tunnels: \"{}\": \"line\": \"{}\" {}", tunnel.name, tunnel.line, problem));
    };
    const auto line = std::ranges::find(lines, tunnel.line, &MarkupLine::name);
    if (line == lines.end()) {
      std::string names;
      for (const MarkupLine& other : lines) names += (names.empty() ? "" : ", ") + other.name;
      refuse(fmt::format("is not a line of {}, which has: {}", model.plan->filename().string(),
                         names.empty() ? "none" : names));
    }
    if (std::ranges::find(taken, tunnel.line) != taken.end()) refuse("is a line of two tunnels");
    taken.push_back(tunnel.line);
    MarkupLine& named = plan.tunnels[std::size_t(line - lines.begin())];
    named.name = tunnel.name;
    named.diameter_mm = tunnel.diameter_mm;
    named.bridge_mm = tunnel.bridge_mm;
    named.enters_at_end = tunnel.enter_at == pipeline::TunnelEnd::end;
  }
}

/// Longer ones may be lines of a sequence's bodies.
void check_lengths(const MarkupPlan& plan, const pipeline::CaseModel& model) {
  using guidance::shortest_tunnel_mm;
  for (const MarkupLine& line : plan.tunnels) {
    const double length = (plan.points[line.end].in_model - plan.points[line.start].in_model).norm();
    if (length >= shortest_tunnel_mm) continue;
    throw BadInput(
        {Reason::bad_tunnel,
         fmt::format("{}: {}: \"{}\" is {:.3g} mm long, must be at least {} mm: is the plan in m?",
                     model.name, model.plan->filename().string(), line.name, length, shortest_tunnel_mm),
         {},
         {{"length_mm", length}, {"limit_mm", shortest_tunnel_mm}}});
  }
}

}  // namespace

std::vector<std::optional<MarkupPlan>> read_plans(const pipeline::Case& the_case) {
  std::map<std::string, std::string> owners;
  for (const pipeline::CaseTunnel& tunnel : the_case.tunnels)
    owners.emplace(tunnel.name, "a tunnel of the case's picks");
  std::vector<std::optional<MarkupPlan>> plans;
  for (const pipeline::CaseModel& model : the_case.models) {
    plans.emplace_back();
    if (!model.plan) continue;
    plans.back() = value_or_throw(read_plan(*model.plan));
    check_lengths(*plans.back(), model);
    name_lines(the_case, model, *plans.back());
    for (const MarkupLine& tunnel : plans.back()->tunnels) {
      const std::string owner =
          fmt::format("a tunnel of \"{}\"'s plan {}", model.name, model.plan->filename().string());
      if (const auto [other, is_new] = owners.emplace(tunnel.name, owner); !is_new)
        refuse_name(tunnel.name, other->second, owner);
    }
    check_points(*plans.back(), the_case, model);
  }
  return plans;
}

}  // namespace helicarm::case_registration
