// SPDX-License-Identifier: Apache-2.0
// Guidance of a hand-held drill during an operation.
#include <cmath>

#include <fmt/format.h>

#include "helicarm/operation/models.h"
#include "helicarm/operation/operation.h"

namespace helicarm::operation {
namespace {

/// Refuses (off_target) a drill that cannot be at the end of its tunnel, however badly that was drilled.
void check_in_tunnel(const TunnelAim& aim) {
  constexpr double farthest_mm = 10, widest_deg = 20;
  const double before_end_mm = aim.length_mm - aim.depth_mm;
  if (aim.distance_mm <= farthest_mm && aim.angle_deg <= widest_deg && std::abs(before_end_mm) <= farthest_mm)
    return;
  if (aim.distance_mm <= farthest_mm && aim.angle_deg <= widest_deg && before_end_mm > 0)
    throw BadInput(
        {Reason::off_target,
         fmt::format("the tip is {:.1f} mm before the tunnel's end: a drilled tunnel is verified within "
                     "{:g} mm of it. Drill {:.1f} mm deeper",
                     before_end_mm, farthest_mm, before_end_mm),
         {},
         {{"before_end_mm", before_end_mm}, {"limit_mm", farthest_mm}}});
  throw BadInput(
      {Reason::off_target,
       fmt::format(
           "the drill is not in the tunnel: its tip is {:.1f} mm beside the axis, {:.1f} mm before the "
           "end, {:.0f} degrees off; limits {:g} mm and {:g} degrees. Put it into the tunnel",
           aim.distance_mm, before_end_mm, aim.angle_deg, farthest_mm, widest_deg),
       {},
       {{"distance_mm", aim.distance_mm}, {"before_end_mm", before_end_mm}, {"angle_deg", aim.angle_deg}}});
}

}  // namespace

Expected<void> Operation::guide(const std::string& name, std::optional<double> oldest) {
  return guarded([&] {
    using enum record::GuidanceEndedBy;
    const double oldest_pose_s = oldest.value_or(plan_.tracker.oldest_pose_s());
    end_guidance(gate_.is_guidance_stale() ? plan_stale : new_guidance);
    const OperationTunnel& tunnel = tunnel_named(name);
    check_not_displaced(tunnel.bone);
    if (const auto missing = checks_to_come(tunnel.bone); !missing.empty())
      throw BadInput(Reason::usage, missing.front() + ": touch this check point first");
    if (!result_) throw BadInput(Reason::usage, "no measurement yet");
    value_or_throw(gate_.check_registered(tunnel));
    notify_(Step::navigate, name);
    const PoseWindow window = look(record::Look::guide);
    value_or_throw(check_error_at_tip(plan_, tunnel, *result_,
                                      value_or_throw(poses_now(window, plan_.tracker)), tool()));
    record(record::Guide{name, oldest_pose_s, window});
    gate_.guide(value_or_throw(FreehandGuide::begin(plan_, value_or_throw(live_tool()), name,
                                                    value_or_throw(poses_now(window, plan_.tracker)),
                                                    oldest_pose_s)));
  });
}

Expected<Guidance> Operation::guidance() {
  return guarded([&] {
    if (!gate_.guide()) throw BadInput(Reason::usage, "no tunnel is guided; begin with a tunnel of the plan");
    if (const auto whole = recorded(); !whole) {
      gate_.end_guidance();
      throw BadInput(whole.error());
    }
    const PoseWindow recent = gate_.guide()->recent(board_, tracker::monotonic_seconds());
    const Guidance now = gate_.guidance(recent);
    if (gate_.is_new(now)) {
      record(record::Guided{gate_.guide()->tunnel().name, recent, now});
      if (now.decision() == code(Reason::plan_stale)) in_place_.clear();
      gate_.shown(now);
    }
    return now;
  });
}

/// Refuses (usage) another tunnel than the guided one, (plan_stale) a guided drill whose bone or marker has
/// moved, and as guided where it is not seen.
TunnelAim Operation::aim_at(const OperationTunnel& tunnel) {
  if (!gate_.guide()) {
    value_or_throw(recorded());
    return value_or_throw(
        mean_aim(value_or_throw(live_tool()), plan_.tracker, tunnel, board_, tracker::monotonic_seconds()));
  }
  if (const std::string& guided = gate_.guide()->tunnel().name; guided != tunnel.name)
    throw BadInput(Reason::usage,
                   fmt::format("{}: the drill is guided to {}; verify that tunnel, or end its guidance",
                               tunnel.name, guided));
  const Guidance now = value_or_throw(guidance());
  if (now.why_not && (!now.aim || now.why_not->reason == Reason::plan_stale)) throw BadInput(*now.why_not);
  return now.aim.value();
}

Expected<TunnelOutcome> Operation::verify_drilled(const std::string& name) {
  return guarded([&] {
    const OperationTunnel& tunnel = tunnel_named(name);
    if (!result_) throw BadInput(Reason::usage, "no measurement yet");
    if (!plan_.drill) throw BadInput(Reason::usage, "the plan has no hand-held drill");
    value_or_throw(gate_.check_registered(tunnel));
    check_in_tunnel(aim_at(tunnel));
    notify_(Step::verify, name);
    TunnelOutcome outcome = check(tunnel);
    in_place_.clear();
    end_guidance(record::GuidanceEndedBy::verified);
    return outcome;
  });
}

Expected<void> Operation::end_guidance() {
  return guarded([&] { end_guidance(record::GuidanceEndedBy::person); });
}

void Operation::end_guidance(record::GuidanceEndedBy by) {
  const auto ended = guidance_ended(by);
  gate_.end_guidance();
  record_ended(ended);
}

std::optional<record::GuidanceEnded> Operation::guidance_ended(record::GuidanceEndedBy by) const {
  if (!gate_.guide()) return std::nullopt;
  return record::GuidanceEnded{gate_.guide()->tunnel().name, by};
}

void Operation::record_ended(const std::optional<record::GuidanceEnded>& ended) {
  if (ended) record(*ended);
}

}  // namespace helicarm::operation
