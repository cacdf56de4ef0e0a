// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay_orders.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/hand_eye_tour.h"
#include "helicarm/operation/records.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

constexpr Range any_place_mm{-1e6, 1e6};
constexpr Range any_angle_rad{-100, 100};

std::string digest_of(const robot::RobotOrder& order) { return xray::digest(to_text(robot::to_json(order))); }

const PlannedTunnel& tunnel_of(const OperationPlan& plan, const std::string& name) {
  const auto tunnel = std::ranges::find(plan.tunnels, name, &PlannedTunnel::name);
  if (tunnel == plan.tunnels.end()) throw BadInput(Reason::bad_value, name + ": is not a tunnel of the plan");
  return *tunnel;
}

std::string text_at(const SessionRecord& record, const char* key) {
  return record.content.at(key).get<std::string>();
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

void OrderReplay::compare(const Json& then, const Json& now, const std::string& origin, const char* what) {
  if (then != now)
    differ_(origin, fmt::format("the {} differs from the recorded value on recomputation{}", what,
                                differing_fields(then, now)));
}

void OrderReplay::take(const Record& record, const OperationPlan& plan,
                       const std::optional<pipeline::Result>& measured,
                       const std::optional<pipeline::Result>& newest) {
  const std::string origin = fmt::format("record {}", record.number);
  if (record.kind == "poses") poses(record, origin);
  if (record.kind == "robot") {
    JsonReader reader(record.content, origin);
    joints_ = Eigen::Map<const robot::Joints>(reader.numbers("joints_rad", 6, any_angle_rad).data());
  }
  if (record.kind == "tour") tour(record, origin);
  if (record.kind == "hand_eye") hand_eye(record, plan, origin);
  if (record.kind == "withdraw") withdraw(record, origin);
  if (record.kind == "order") order(record, plan, measured, origin);
  if (record.kind == "confirmed") confirmed(record, origin);
  if (record.kind == "carried_out") carried_out(record, origin);
  if (record.kind == "halted") halted(record);
  if (record.kind == "replanned") replanned(record, plan, origin);
  if (record.kind == "navigated") navigated(record, plan, origin);
  if (record.kind == "outcome") outcome(record, plan, newest, origin);
  if (record.kind == "end") end(record, origin);
}

std::optional<TrackedTool> OrderReplay::tool(const OperationPlan& plan) const {
  if (plan.drill) return tracked_tool(*plan.drill);
  if (hand_eye_) return tracked_tool(*hand_eye_, plan.robot.tool);
  return std::nullopt;
}

void OrderReplay::poses(const Record& record, const std::string& origin) {
  PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
  const std::string why = text_at(record, "why");
  if (why == "hand-eye")
    looks_.push_back(std::move(window));
  else if (why == "correct")
    corrections_.push_back(std::move(window));
  else if (why == "verify")
    verify_look_ = std::move(window);
  else if (why == "plan") {
    plan_look_ = std::move(window);
    leaving_.reset();
  }
}

void OrderReplay::tour(const Record& record, const std::string& origin) {
  JsonReader reader(record.content, origin);
  whole_tour_ = hand_eye_tour(geometry::exact_pose_from(reader, "base_from_tcp", any_place_mm));
  tour_.assign(whole_tour_.begin(), whole_tour_.end());
  looks_.clear();
  plan_look_.reset();
  leaving_.reset();
}

/// The tool's poses in its pairs are those that the tracker saw.
void OrderReplay::hand_eye(const Record& record, const OperationPlan& plan, const std::string& origin) {
  auto pairs = value_or_throw(hand_eye_pairs_from(record.content.at("pairs"), origin));
  const auto found = tracker::calibrate_hand_eye(pairs);
  compare(record.content.at("found"), found ? to_json(*found) : Json(), origin, "hand-eye calibration");
  if (found) hand_eye_ = *found;
  if (pairs.size() != looks_.size())
    return differ_(origin, "the pairs of the hand-eye calibration are not those that the tracker saw");
  for (std::size_t i = 0; i < pairs.size(); ++i)
    pairs[i].tracker_from_marker =
        value_or_throw(see_tool(looks_[i], plan.tracker, plan.tracker.tool)).tracker_from_marker;
  compare(record.content.at("pairs"), to_json(pairs), origin, "tool's poses of the hand-eye calibration");
}

void OrderReplay::withdraw(const Record& record, const std::string& origin) {
  JsonReader reader(record.content, origin);
  leaving_ = Leaving{text_at(record, "digest"),
                     {geometry::exact_pose_from(reader, "base_from_tcp", any_place_mm),
                      geometry::exact_pose_from(reader, "base_from_rest", any_place_mm)}};
  plan_look_.reset();
}

/// From the records before it; `planned` if it leads to a tunnel.
robot::RobotOrder OrderReplay::derived(const std::string& name, const OperationPlan& plan,
                                       const std::optional<pipeline::Result>& result,
                                       std::optional<Planned>& planned) {
  const auto missing = [](const char* what) { throw BadInput(Reason::bad_value, what); };
  if (!joints_) missing("no joints of the robot are recorded for it");
  if (leaving_) {
    const auto to = planned_.find(leaving_->digest);
    if (to == planned_.end()) missing("it withdraws from an order that was not planned");
    return withdraw_order(to->second.order, leaving_->from, *joints_, plan.robot.approach.limits);
  }
  if (plan_look_) {
    if (!result || !hand_eye_) missing("no measurement or no registration was made before it");
    const PlannedTunnel& tunnel = tunnel_of(plan, name);
    const guidance::Poses now = value_or_throw(poses_now(*plan_look_, plan.tracker));
    const robot::RobotOrder order =
        value_or_throw(tunnel_order(plan, tunnel, *result, *hand_eye_, now, *joints_));
    planned = Planned{order, tunnel.bone, target_in_bone(order, tunnel.bone, now, *hand_eye_)};
    return order;
  }
  if (tour_.empty()) missing("neither poses nor a tour are recorded for it");
  robot::RobotState present;
  present.joints = *joints_;
  robot::RobotOrder order = tour_order(plan.robot, present, tour_.front());
  tour_.pop_front();
  return order;
}

void OrderReplay::order(const Record& record, const OperationPlan& plan,
                        const std::optional<pipeline::Result>& result, const std::string& origin) {
  ++orders;
  const std::string name = text_at(record, "name");
  std::optional<Planned> planned;
  const auto order = guarded([&] { return derived(name, plan, result, planned); });
  joints_.reset();
  plan_look_.reset();
  leaving_.reset();
  const std::string digest = xray::digest(to_text(record.content));
  (planned ? to_ : other_)[name] = digest;
  if (!order) return differ_(origin, fmt::format("order {}: {}", name, order.error().message));
  compare(record.content, robot::to_json(*order), origin, "order");
  if (planned) planned_[digest_of(*order)] = *planned;
}

void OrderReplay::confirmed(const Record& record, const std::string& origin) {
  ++confirmations;
  if (open_) differ_(origin, "a confirmation before the end of the previous motion");
  const std::string name = text_at(record, "order"), digest = text_at(record, "digest");
  const auto is_last = [&](const std::map<std::string, std::string>& of) {
    const auto last = of.find(name);
    return last != of.end() && last->second == digest;
  };
  if (!is_last(to_) && !is_last(other_))
    differ_(origin, fmt::format("the confirmation is not of the last order {}", name));
  open_ = record.content;
  corrections_.clear();
}

void OrderReplay::carried_out(const Record& record, const std::string& origin) {
  if (!open_ || *open_ != record.content) differ_(origin, "the motion is not that which was confirmed");
  open_.reset();
  const auto planned = planned_.find(text_at(record, "digest"));
  reached_ = planned == planned_.end() ? std::nullopt : std::optional(planned->second);
}

void OrderReplay::halted(const Record& record) {
  const std::string order = text_at(record, "order");
  if (open_ && open_->at("order") == order) open_.reset();
  if (unverified_ == order) unverified_.clear();
}

/// A confirmation after it needs a new order. A registration goes on at the first pose at which the tracker
/// has not seen the tool.
void OrderReplay::replanned(const Record& record, const OperationPlan& plan, const std::string& origin) {
  ++replans;
  const std::string name = text_at(record, "order");
  if (const int number = ++replans_[name]; record.content.at("number") != number || number > most_replans)
    differ_(origin, fmt::format("{} was planned again {} times by its records, limit {}", name, number,
                                most_replans));
  if (open_) differ_(origin, "planned again before the end of the motion");
  to_.erase(name);
  other_.erase(name);
  if (name != tour_name) return;
  while (!looks_.empty() && !see_tool(looks_.back(), plan.tracker, plan.tracker.tool)) looks_.pop_back();
  const std::size_t seen = std::min(looks_.size(), whole_tour_.size());
  tour_.assign(whole_tour_.begin() + static_cast<std::ptrdiff_t>(seen), whole_tour_.end());
}

void OrderReplay::navigated(const Record& record, const OperationPlan& plan, const std::string& origin) {
  const std::string name = text_at(record, "tunnel");
  unverified_ = name;
  if (!reached_ || reached_->order.name != name || !hand_eye_)
    return differ_(origin, fmt::format("no order to {} was carried out", name));
  if (reached_->order.corrections.most == 0) return;  // by the robot's own pose
  std::vector<robot::Miss> loop;
  for (const PoseWindow& window : corrections_)
    loop.push_back(value_or_throw(robot::miss_of(
        value_or_throw(measure_tool(window, plan, *hand_eye_, reached_->bone, reached_->bone_from_target)))));
  compare(record.content.at("loop"), to_json(loop), origin, "closed loop");
}

void OrderReplay::outcome(const Record& record, const OperationPlan& plan,
                          const std::optional<pipeline::Result>& result, const std::string& origin) {
  ++outcomes;
  const std::string name = text_at(record, "tunnel");
  if (unverified_ == name) unverified_.clear();
  const auto with = tool(plan);
  if (!result || !with) return differ_(origin, "an outcome without a measurement or a registration");
  const auto now = guarded([&] { return value_or_throw(outcome_of(tunnel_of(plan, name), *result, *with)); });
  if (!now) return differ_(origin, now.error().message);
  compare(record.content, to_json(*now), origin, "outcome");
}

void OrderReplay::end(const Record& record, const std::string& origin) {
  if (open_) differ_(origin, fmt::format("the motion by order {} has no end", open_->at("order").dump()));
  if (!unverified_.empty() && !record.content.contains("why"))
    differ_(origin, fmt::format("the outcome at {} is missing", unverified_));
}

}  // namespace helicarm::operation
