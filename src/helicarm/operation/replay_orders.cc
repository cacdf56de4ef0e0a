// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay_orders.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/operation/hand_eye_tour.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

std::string digest_of(const robot::RobotOrder& order) { return xray::digest(to_text(robot::to_json(order))); }

const OperationTunnel& tunnel_of(const OperationPlan& plan, const std::string& name) {
  const auto tunnel = std::ranges::find(plan.tunnels, name, &OperationTunnel::name);
  if (tunnel == plan.tunnels.end()) throw BadInput(Reason::bad_value, name + ": is not a tunnel of the plan");
  return *tunnel;
}

}  // namespace

std::string differing_fields(const Json& then, const Json& now) {
  constexpr std::size_t most = 4;
  const Json patch = Json::diff(then, now);
  std::string fields;
  for (std::size_t i = 0; i < std::min(most, patch.size()); ++i)
    fields += (i == 0 ? ": " : ", ") + patch[i].at("path").get<std::string>();
  if (patch.size() > most) fields += fmt::format(" and {} more", patch.size() - most);
  return fields;
}

void OrderReplay::compare(const Json& then, const Json& now, const Context& at, const char* what) {
  if (then != now)
    differ_(at.origin, fmt::format("the {} differs from the recorded value on recomputation{}", what,
                                   differing_fields(then, now)));
}

void OrderReplay::follow(const Record& record, const Context& at) {
  std::visit([&](const auto& one) { take(one, at); }, record);
}

std::optional<TrackedTool> OrderReplay::tool(const OperationPlan& plan) const {
  if (plan.drill) return tracked_tool(*plan.drill);
  if (hand_eye_) return tracked_tool(*hand_eye_, plan.robot.tool);
  return std::nullopt;
}

void OrderReplay::take(const record::Poses& poses, const Context&) {
  using enum record::Look;
  switch (poses.why) {
    case hand_eye:
      looks_.push_back(poses.window);
      break;
    case correct:
      corrections_.push_back(poses.window);
      break;
    case verify:
      verify_look_ = poses.window;
      break;
    case plan:
      plan_look_ = poses.window;
      leaving_.reset();
      break;
    case withdraw:
    case guide:
      break;
  }
}

void OrderReplay::take(const record::Robot& robot, const Context&) { joints_ = robot.joints; }

void OrderReplay::take(const record::Tour& tour, const Context&) {
  whole_tour_ = hand_eye_tour(tour.base_from_tcp);
  tour_.assign(whole_tour_.begin(), whole_tour_.end());
  looks_.clear();
  plan_look_.reset();
  leaving_.reset();
}

/// The tool's poses in its pairs are those that the tracker saw.
void OrderReplay::take(const record::HandEye& then, const Context& at) {
  const auto found = tracker::calibrate_hand_eye(then.pairs);
  if (!found) return differ_(at.origin, found.error().message);
  hand_eye_ = *found;
  record::HandEye now{then.pairs, *found};
  if (now.pairs.size() != looks_.size())
    return differ_(at.origin, "the pairs of the hand-eye calibration are not those that the tracker saw");
  for (std::size_t i = 0; i < now.pairs.size(); ++i)
    now.pairs[i].tracker_from_marker =
        value_or_throw(see_tool(looks_[i], at.plan.tracker, at.plan.tracker.tool)).tracker_from_marker;
  compare(content_of(then), content_of(now), at, "hand-eye calibration");
}

void OrderReplay::take(const record::Withdraw& withdraw, const Context&) {
  leaving_ = Leaving{withdraw.digest, withdraw.from};
  plan_look_.reset();
}

/// From the records before it; `planned` if it leads to a tunnel.
robot::RobotOrder OrderReplay::derived(const std::string& name, const Context& at,
                                       std::optional<Planned>& planned) {
  const auto missing = [](const char* what) { throw BadInput(Reason::bad_value, what); };
  if (!joints_) missing("no joints of the robot are recorded for it");
  if (leaving_) {
    const auto to = planned_.find(leaving_->digest);
    if (to == planned_.end()) missing("it withdraws from an order that was not planned");
    return withdraw_order(to->second.order, leaving_->from, *joints_, at.plan.robot.approach.limits);
  }
  if (plan_look_) {
    if (!at.measured || !hand_eye_) missing("no measurement or no registration was made before it");
    const OperationTunnel& tunnel = tunnel_of(at.plan, name);
    const guidance::Poses now = value_or_throw(poses_now(*plan_look_, at.plan.tracker));
    const robot::RobotOrder order =
        value_or_throw(tunnel_order(at.plan, tunnel, *at.measured, *hand_eye_, now, *joints_));
    planned = Planned{order, tunnel.bone, target_in_bone(order, tunnel.bone, now, *hand_eye_)};
    return order;
  }
  if (tour_.empty()) missing("neither poses nor a tour are recorded for it");
  robot::RobotState present;
  present.joints = *joints_;
  robot::RobotOrder order = tour_order(at.plan.robot, present, tour_.front());
  tour_.pop_front();
  return order;
}

void OrderReplay::take(const record::Order& then, const Context& at) {
  ++orders;
  const std::string& name = then.order.name;
  std::optional<Planned> planned;
  const auto order = guarded([&] { return derived(name, at, planned); });
  joints_.reset();
  plan_look_.reset();
  leaving_.reset();
  (planned ? to_ : other_)[name] = xray::digest(to_text(then.text));
  if (!order) return differ_(at.origin, fmt::format("order {}: {}", name, order.error().message));
  compare(then.text, robot::to_json(*order), at, "order");
  if (planned) planned_[digest_of(*order)] = *planned;
}

void OrderReplay::take(const record::Confirmed& confirmed, const Context& at) {
  ++confirmations;
  if (open_) differ_(at.origin, "a confirmation before the end of the previous motion");
  const auto is_last = [&](const std::map<std::string, std::string>& of) {
    const auto last = of.find(confirmed.order);
    return last != of.end() && last->second == confirmed.digest;
  };
  if (!is_last(to_) && !is_last(other_))
    differ_(at.origin, fmt::format("the confirmation is not of the last order {}", confirmed.order));
  open_ = confirmed;
  corrections_.clear();
}

void OrderReplay::take(const record::CarriedOut& carried_out, const Context& at) {
  if (open_ != carried_out.confirmed) differ_(at.origin, "the motion is not that which was confirmed");
  open_.reset();
  const auto planned = planned_.find(carried_out.confirmed.digest);
  reached_ = planned == planned_.end() ? std::nullopt : std::optional(planned->second);
}

void OrderReplay::take(const record::Halted& halted, const Context&) {
  if (open_ && open_->order == halted.order) open_.reset();
  if (unverified_ == halted.order) unverified_.clear();
}

/// A confirmation after it needs a new order. A registration goes on at the first pose at which the tracker
/// has not seen the tool.
void OrderReplay::take(const record::Replanned& replanned, const Context& at) {
  ++replans;
  const std::string& name = replanned.order;
  if (const int number = ++replans_[name]; replanned.number != number || number > most_replans)
    differ_(at.origin, fmt::format("{} was planned again {} times by its records, limit {}", name, number,
                                   most_replans));
  if (open_) differ_(at.origin, "planned again before the end of the motion");
  to_.erase(name);
  other_.erase(name);
  if (name != tour_name) return;
  while (!looks_.empty() && !see_tool(looks_.back(), at.plan.tracker, at.plan.tracker.tool))
    looks_.pop_back();
  const std::size_t seen = std::min(looks_.size(), whole_tour_.size());
  tour_.assign(whole_tour_.begin() + static_cast<std::ptrdiff_t>(seen), whole_tour_.end());
}

void OrderReplay::take(const record::Navigated& then, const Context& at) {
  unverified_ = then.tunnel;
  if (!reached_ || reached_->order.name != then.tunnel || !hand_eye_)
    return differ_(at.origin, fmt::format("no order to {} was carried out", then.tunnel));
  if (reached_->order.corrections.most == 0) return;  // by the robot's own pose
  record::Navigated now{then.tunnel, {}};
  for (const PoseWindow& window : corrections_)
    now.loop.push_back(value_or_throw(robot::miss_of(value_or_throw(
        measure_tool(window, at.plan, *hand_eye_, reached_->bone, reached_->bone_from_target)))));
  compare(content_of(then), content_of(now), at, "closed loop");
}

void OrderReplay::take(const record::Outcome& then, const Context& at) {
  ++outcomes;
  if (unverified_ == then.tunnel) unverified_.clear();
  const auto with = tool(at.plan);
  if (!at.newest || !with) return differ_(at.origin, "an outcome without a measurement or a registration");
  const auto now = outcome_of(tunnel_of(at.plan, then.tunnel), *at.newest, *with);
  if (!now) return differ_(at.origin, now.error().message);
  compare(content_of(then), content_of(record::Outcome{now->tunnel, now->start, now->end, now->depth()}), at,
          "outcome");
}

void OrderReplay::take(const record::End& end, const Context& at) {
  if (open_) differ_(at.origin, fmt::format("the motion by order {} has no end", open_->order));
  if (!unverified_.empty() && !end.why)
    differ_(at.origin, fmt::format("the outcome at {} is missing", unverified_));
}

}  // namespace helicarm::operation
