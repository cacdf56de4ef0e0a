// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/plan.h"
#include "helicarm/core/text.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto plan = case_registration::read_plan(put_file("input.mrk.json", bytes));
  if (!plan) return;
  for (const case_registration::PlanPoint& point : plan->points) {
    check(point.in_model.allFinite() && point.in_model.cwiseAbs().maxCoeff() <= 10000, "points are near");
    check(!point.name.empty() && !holds_control_character(point.name), "a point has a name");
  }
  for (const case_registration::MarkupLine& tunnel : plan->tunnels)
    check(tunnel.start < plan->points.size() && tunnel.end < plan->points.size(), "a tunnel names points");
}

std::vector<std::string> seeds() {
  return {
      R"({"@schema": "x", "markups": [{"type": "Line", "name": "tunnel", "coordinateSystem": "RAS",
          "coordinateUnits": "cm", "controlPoints": [{"label": "1", "position": [0, 0, 0], "positionStatus": "defined"},
          {"label": "2", "position": [0, 1, 3]}]}]})",
      R"({"markups": [{"type": "Fiducial", "coordinateSystem": 1, "controlPoints":
          [{"label": "entry", "position": [1, 2, 3]}, {"position": [4, 5, 6], "positionStatus": "undefined"}]}]})"};
}

}  // namespace helicarm::fuzz
