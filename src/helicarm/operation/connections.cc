// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/connections.h"

#include <chrono>

#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/tracker/tracker_registry.h"

namespace helicarm::operation {
namespace {

robot::RobotConfig config_of(const RobotPlan& plan, const FreshnessLimits& limits) {
  robot::RobotConfig config;
  config.model = value_or_throw(robot::robot_model(plan.model));
  config.address = plan.address;
  config.rtde_port = plan.rtde_port;
  config.dashboard_port = plan.dashboard_port;
  config.script_port = plan.script_port;
  config.limits = plan.approach.limits;
  config.stale_s = limits.state_s;
  config.program_silence_s = limits.heartbeat_s;
  return config;
}

tracker::PoseBoardOptions board_options(const FreshnessLimits& limits) {
  tracker::PoseBoardOptions options;
  options.max_age_s = limits.pose_s;
  options.gate.frozen_s = limits.frozen_s;
  return options;
}

}  // namespace

FreshnessLimits freshness_limits(const TrackerPlan& tracker) { return {.pose_s = tracker.oldest_pose_s()}; }

Connections::Connections(const OperationPlan& plan, std::unique_ptr<receiver::Inbox> inbox,
                         const FreshnessLimits& limits)
    : inbox_(std::move(inbox)), board_(board_options(limits)) {
  if (!plan.drill) robot_ = std::make_unique<robot::RobotLink>(config_of(plan.robot, limits));
  tracker_ = value_or_throw(tracker::open_tracker(tracker_address(plan), tracker::onto(board_)));
}

robot::RobotLink& Connections::robot() {
  if (!robot_) throw BadInput(Reason::usage, "the plan has a hand-held drill and no robot");
  return *robot_;
}

Expected<void> Connections::listen(const receiver::ImageSourceOptions& options) {
  receiver::ReceiverHooks hooks;
  hooks.arrived = [this](const receiver::Arrival& arrival) {
    const std::lock_guard lock(mutex_);
    arrivals_.push_back({arrival, tracker::monotonic_seconds()});
    c_arm_ = {arrivals_.back().time_s, {}};
    broken_before_ = broken();
    news_.notify_all();
  };
  hooks.refused = [this](const Failure& why) {
    const std::lock_guard lock(mutex_);
    c_arm_.refused = why;
  };
  return receiver::open_images(options, *inbox_, std::move(hooks))
      .map([this](std::unique_ptr<receiver::ImageSource> images) {
        const std::lock_guard lock(mutex_);
        images_ = std::move(images);
      });
}

CArmStatus Connections::c_arm() const {
  const std::lock_guard lock(mutex_);
  CArmStatus status = c_arm_;
  status.broke_off = broken() > broken_before_;
  return status;
}

std::optional<DatedArrival> Connections::next_image(double patience_s) {
  std::unique_lock lock(mutex_);
  if (!news_.wait_for(lock, std::chrono::duration<double>(patience_s), [&] { return !arrivals_.empty(); }))
    return std::nullopt;
  DatedArrival arrival = std::move(arrivals_.front());
  arrivals_.pop_front();
  return arrival;
}

}  // namespace helicarm::operation
