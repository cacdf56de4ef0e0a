// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const operation::OperationPlan& plan) { return to_json(plan); }

}  // namespace

void run(std::string_view bytes) {
  run_round_trip(
      bytes, [](const Json& json) { return operation::plan_from(json, "plan.json"); }, write);
}

std::vector<std::string> seeds() {
  operation::OperationPlan plan;
  plan.tracker.facets = {{"calibrator/1", {Eigen::Matrix3d::Identity(), {85, 0, 10}}}};
  plan.robot.tool = {{Eigen::Matrix3d::Identity(), {0, 0, 150}}, 1.2};
  plan.tunnels = {{"femur", "femur", "FS", "FE", operation::TunnelEnd::end}};
  operation::OperationPlan full = plan;
  full.robot.approach.keep_outs = {{{0, 0, -200}, Eigen::Vector3d::UnitZ()}};
  full.tracker.pointer = operation::Pointer{"pointer", {0, 0, 120}};
  full.check_points = {{"divot", "tibia", 1}};
  full.picks = {{.name = "FS", .view = "AP", .uv_raw = {10, 20}, .sigma_px = {}, .moves_with = {}}};
  full.plate.reset();
  return {write(plan).dump(), write(full).dump()};
}

}  // namespace helicarm::fuzz
