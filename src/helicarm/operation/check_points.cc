// SPDX-License-Identifier: Apache-2.0
// Whether the markers have moved on the bones since the first X-ray image.
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/operation.h"

namespace helicarm::operation {

std::vector<std::string> Operation::checks_to_come(const guidance::Bone& bone) const {
  std::vector<std::string> names;
  for (const PlannedCheck& check : plan_.check_points)
    if (check.bone == bone && !in_place_.contains(check.name)) names.push_back(check.name);
  return names;
}

void Operation::end_plans_to(const guidance::Bone& bone, const Failure& why) {
  std::vector<std::string> ended;
  for (const OperationTunnel& tunnel : plan_.tunnels)
    if (tunnel.bone == bone && gate_.planned(tunnel.name) && !gate_.is_stale(tunnel.name)) {
      gate_.found_stale(tunnel.name, why);
      ended.push_back(tunnel.name);
    }
  const bool is_guided = gate_.guide() && gate_.guide()->tunnel().bone == bone;
  const auto guidance = is_guided ? guidance_ended(record::GuidanceEndedBy::check_point) : std::nullopt;
  if (is_guided) gate_.end_guidance();
  // The first reason is reported, also where it cannot be recorded.
  static_cast<void>(guarded([&] {
    for (const std::string& tunnel : ended) record_halt(tunnel, why);
    record_ended(guidance);
  }));
}

void Operation::check_not_displaced(const guidance::Bone& bone) const {
  if (const auto moved = displaced_.find(bone); moved != displaced_.end()) throw BadInput(moved->second);
}

Expected<double> Operation::touch(const std::string& name) {
  return guarded([&]() -> double {
    const auto check = std::ranges::find(plan_.check_points, name, &PlannedCheck::name);
    if (check == plan_.check_points.end())
      throw BadInput(Reason::bad_value, fmt::format("{}: is not a check point of the plan", name));
    check_not_displaced(check->bone);
    const auto first = touched_in_bone_.find(name);
    if (first == touched_in_bone_.end() && !views_.empty())
      throw BadInput(Reason::usage, fmt::format("{}: must be touched before the first image", name));
    const PoseWindow window = window_now(board_, plan_.tracker, end_.get_token());
    const Eigen::Vector3d tip = value_or_throw(touched_in_bone(window, plan_.tracker, check->bone));
    record(record::Touched{name, window, tip});
    if (first == touched_in_bone_.end()) {
      touched_in_bone_[name] = tip;
      return 0;
    }
    in_place_.erase(name);
    const auto off = tracker::check_point_off_mm({first->second, check->limit_mm},
                                                 {Eigen::Matrix3d::Identity(), {0, 0, 0}}, tip);
    if (!off) {
      Failure moved = off.error();
      moved.message = fmt::format(
          "{}: is {:.2f} mm from its position in the frame of the {} marker, limit {:g} mm: the marker moved "
          "on the bone or was assigned to the wrong bone; begin a new operation",
          name, moved.figures.at("off_mm"), plan_.tracker.marker_of(check->bone), check->limit_mm);
      displaced_.emplace(check->bone, moved);
      end_plans_to(check->bone, moved);
      throw BadInput(std::move(moved));
    }
    // A marker may move until the last image: its tunnels are then located where it was.
    if (views_to_come().empty()) in_place_.insert(name);
    return *off;
  });
}

}  // namespace helicarm::operation
