// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/guidance_gate.h"

#include <utility>

#include <fmt/format.h>

#include "helicarm/core/reason_code.h"

namespace helicarm::operation {

void GuidanceGate::registered(std::optional<Failure> refusal) {
  refusal_ = std::move(refusal);
  state_ = refusal_ ? Registration::refused : Registration::registered;
}

Expected<void> GuidanceGate::confirmable() const {
  if (state_ == Registration::none)
    return fail(Reason::usage, "no registration to confirm; register the models first");
  if (refusal_) return tl::unexpected<Failure>(*refusal_);
  return {};
}

Expected<void> GuidanceGate::confirm() {
  return confirmable().map([&] { state_ = Registration::confirmed; });
}

void GuidanceGate::forget_registration(std::span<const OperationTunnel> tunnels) {
  was_registered_ = was_registered_ || state_ != Registration::none;
  state_ = Registration::none;
  refusal_.reset();
  for (const OperationTunnel& tunnel : tunnels)
    if (tunnel.of_model) {
      planned_.erase(tunnel.name);
      if (guide_ && guide_->tunnel().name == tunnel.name) end_guidance();
    }
}

void GuidanceGate::forget_plans() {
  planned_.clear();
  end_guidance();
}

Expected<void> GuidanceGate::check_registered(const OperationTunnel& tunnel) const {
  if (!tunnel.of_model || is_confirmed()) return {};
  const std::string& model = tunnel.of_model->model;
  if (state_ != Registration::none)
    return fail(Reason::registration_not_confirmed,
                fmt::format("{}: the registration of \"{}\" is not confirmed: look at its overlays, and "
                            "confirm that the outline follows the bone in every view",
                            tunnel.name, model));
  if (was_registered_)
    return fail(Reason::registration_stale,
                fmt::format("{}: images or picks were taken again since \"{}\" was registered: register the "
                            "models again",
                            tunnel.name, model));
  return fail(Reason::registration_not_confirmed,
              fmt::format("{}: \"{}\" is not registered: register the models first", tunnel.name, model));
}

void GuidanceGate::plan(const std::string& tunnel, PlannedOrder planned) {
  planned_.insert_or_assign(tunnel, std::move(planned));
}

Expected<PlannedOrder> GuidanceGate::planned(const std::string& tunnel) const {
  const auto found = planned_.find(tunnel);
  if (found == planned_.end())
    return fail(Reason::usage, tunnel + ": was not planned in this operation; plan it first");
  return found->second;
}

bool GuidanceGate::is_planned(const robot::RobotOrder& order) const {
  const auto found = planned_.find(order.name);
  return found != planned_.end() && found->second.order == to_text(robot::to_json(order));
}

bool GuidanceGate::is_stale(const std::string& tunnel) const {
  const auto found = planned_.find(tunnel);
  return found != planned_.end() && found->second.stale;
}

void GuidanceGate::found_stale(const std::string& tunnel, const Failure& why) {
  if (const auto found = planned_.find(tunnel); found != planned_.end()) found->second.stale = why;
}

Expected<void> GuidanceGate::may_move(const robot::RobotOrder& order, const OperationTunnel& tunnel,
                                      const tracker::PoseBoard& board, const robot::ToolTrack& track,
                                      double now_s) {
  return guarded([&] {
    value_or_throw(check_registered(tunnel));
    const PlannedOrder plan = value_or_throw(planned(order.name));
    if (!is_planned(order))
      throw BadInput(
          Reason::plan_stale,
          order.name + ": is not the last plan to this tunnel: confirm the last one or plan again");
    if (plan.stale) throw BadInput(*plan.stale);
    const auto holds = plan.watch.holds(board, track, now_s);
    if (!holds && holds.error().reason == Reason::plan_stale) found_stale(order.name, holds.error());
    value_or_throw(holds);
  });
}

void GuidanceGate::guide(FreehandGuide guide) {
  shown_.reset();
  guide_ = std::move(guide);
}

void GuidanceGate::end_guidance() {
  guide_.reset();
  shown_.reset();
}

Guidance GuidanceGate::guidance(const PoseWindow& recent) const {
  Guidance now = guide_->at(recent);
  if (is_guidance_stale()) now.why_not = shown_->why_not;
  return now;
}

bool GuidanceGate::is_guidance_stale() const {
  return shown_ && shown_->decision() == code(Reason::plan_stale);
}

bool GuidanceGate::is_new(const Guidance& guidance) const {
  return !shown_ || shown_->decision() != guidance.decision();
}

}  // namespace helicarm::operation
