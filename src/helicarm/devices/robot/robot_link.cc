// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_link.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/real_time.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/robot/straight_path.h"

namespace helicarm::robot {
namespace {

using Milliseconds = std::chrono::milliseconds;

constexpr double correction_mm_s = 10;
constexpr double correction_mm_s2 = 100;
/// Supervision runs every 20 ms; a longer interval means that the whole machine was stalled.
constexpr Milliseconds held_up{50};
/// After a stall, waiting states and poses are read from the sockets first.
constexpr Milliseconds catch_up{20};

std::chrono::steady_clock::duration clock_duration(double s) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

}  // namespace

RobotLink::RobotLink(RobotConfig config) : RobotLink(config, open_driver(config)) {}

RobotLink::RobotLink(RobotConfig config, std::unique_ptr<RobotDriver> driver)
    : config_(std::move(config)),
      machine_({.stale_s = config_.stale_s,
                .program_silence_s = config_.program_silence_s,
                .start_s = config_.start_s}),
      driver_(std::move(driver)) {
  driver_->start({.connected =
                      [this](const ControllerVersion& version) {
                        const std::lock_guard lock(guard_);
                        version_ = version;
                      },
                  .state =
                      [this](const RobotState& state) {
                        track_.take(state.time_s, state.base_from_tcp,
                                    std::chrono::duration<double>(Clock::now().time_since_epoch()).count());
                        const std::lock_guard lock(guard_);
                        const Heartbeat answer = machine_.heard(state, Clock::now());
                        changed();
                        return answer;
                      },
                  .lost =
                      [this](const Failure& failure) {
                        track_.forget();
                        const std::lock_guard lock(guard_);
                        machine_.lost(failure);
                        changed();
                      }});
}

RobotLink::~RobotLink() = default;

/// Call under the guard. The channel stays open while its order may move.
void RobotLink::changed() {
  if (!machine_.permits()) channel_.reset();
  news_.notify_all();
}

RobotLinkStatus RobotLink::status() const {
  const std::lock_guard lock(guard_);
  const auto& state = machine_.state();
  RobotLinkStatus status{
      machine_.phase(), machine_.why(), state, state ? machine_.age_s(Clock::now()) : 0, version_, {},
      machine_.stops()};
  if (!state) return status;
  const double mismatch = kinematic_mismatch_mm(config_.model, *state);
  if (mismatch > config_.mismatch_mm)
    status.warnings.push_back(
        {Reason::off_target,
         fmt::format("the arm differs by {:.2f} mm from the nominal {}: use corrections by the tracker",
                     mismatch, config_.model.name),
         {},
         {{"mismatch_mm", mismatch}}});
  std::ranges::move(driver_->advisories(version_), std::back_inserter(status.warnings));
  return status;
}

Expected<RobotState> RobotLink::wait_connected(Clock::duration patience) const {
  std::unique_lock lock(guard_);
  news_.wait_for(lock, patience, [&] { return machine_.state().has_value(); });
  if (machine_.state()) return *machine_.state();
  return tl::unexpected<Failure>(
      machine_.why().value_or(Failure{Reason::not_connected, "the robot does not respond"}));
}

Expected<void> RobotLink::unlock(const std::string& who, const RobotLinkStatus& shown) {
  if (who.empty() || who.size() > 100 || holds_control_character(who))
    return fail(Reason::bad_value, "the name of the user who unlocks the robot is missing");
  const auto present = wait_connected({});
  if (!present) return tl::unexpected<Failure>(present.error());
  if (auto remote = driver_->check_remote_control(); !remote) return remote;
  const auto is_protective = [&] {
    const std::lock_guard lock(guard_);
    return machine_.none_since(shown.stops).map([&] {
      return machine_.state() && machine_.state()->safety_mode == SafetyMode::protective_stop;
    });
  }();
  if (!is_protective) return tl::unexpected<Failure>(is_protective.error());
  if (*is_protective) {
    if (auto released = driver_->release_protective_stop(); !released) return released;
    std::unique_lock lock(guard_);
    news_.wait_for(lock, clock_duration(config_.start_s),
                   [&] { return machine_.state() && !why_stopped(*machine_.state()); });
  }
  const std::lock_guard lock(guard_);
  return machine_.unlock(shown.stops, Clock::now());
}

void RobotLink::stop() {
  const std::lock_guard lock(guard_);
  machine_.stop({Reason::robot_stopped, "stopped by the user"});
  changed();
}

std::string RobotLink::confirm(const RobotOrder& order) {
  const std::lock_guard lock(guard_);
  return machine_.confirm(order, Clock::now());
}

Expected<RobotState> RobotLink::run(const RobotOrder& order, Stops since, const Watch& watch) {
  if (auto remote = driver_->check_remote_control(); !remote) return tl::unexpected<Failure>(remote.error());
  if (auto watched = watch(); !watched) return tl::unexpected<Failure>(watched.error());
  if (auto sent = send(order, since); !sent) return tl::unexpected<Failure>(sent.error());
  return supervise(since, watch);
}

/// Check, permission and sending are one critical section, so that no stop occurs in between.
Expected<void> RobotLink::send(const RobotOrder& order, Stops since) {
  auto channel = driver_->open_channel();
  if (!channel) return tl::unexpected<Failure>(channel.error());
  const std::lock_guard lock(guard_);
  if (auto ready = machine_.ready(since, Clock::now()); !ready) return ready;
  if (auto sound = check_order(order, *machine_.state(), config_.limits); !sound) return sound;
  const auto number = machine_.begin(since, 1.5 * duration_s(order), Clock::now());
  if (!number) return tl::unexpected<Failure>(number.error());
  channel_ = *std::move(channel);
  if (auto sent = channel_->send(order, *number); !sent) {
    machine_.stop(sent.error());
    changed();
    return sent;
  }
  return {};
}

Expected<RobotState> RobotLink::supervise(Stops since, const Watch& watch) {
  const RealTime priority;
  auto looked = Clock::now();
  std::unique_lock lock(guard_);
  for (;;) {
    if (Clock::now() - std::exchange(looked, Clock::now()) > held_up)  // no heartbeat meanwhile
      news_.wait_for(lock, catch_up, [&] { return machine_.stops() != since; });
    lock.unlock();  // a stop does not wait for the watch
    const auto watched = watch();
    lock.lock();
    const auto done = watched ? machine_.look(since, Clock::now())
                              : tl::unexpected<Failure>(machine_.stop_order(since, watched.error()));
    if (!done || *done) changed();
    if (!done) return tl::unexpected<Failure>(done.error());
    if (*done) return *machine_.state();
    news_.wait_for(lock, Milliseconds(20));
  }
}

Expected<void> RobotLink::correct(const RobotOrder& order, Stops since,
                                  const geometry::RigidTransform& tcp_from_new, const Watch& watch) {
  const auto present = wait_connected({});
  if (!present) return tl::unexpected<Failure>(present.error());
  RobotOrder small = order;
  small.start = present->joints;
  small.waypoints = {{present->base_from_tcp * tcp_from_new, correction_mm_s, correction_mm_s2}};
  const auto ended = run(small, since, watch);
  if (!ended) return tl::unexpected<Failure>(ended.error());
  return {};
}

Expected<std::vector<Miss>> RobotLink::execute(const RobotOrder& order, const std::string& token,
                                               const Measure& measure, const Watch& watch) {
  const std::unique_lock one_at_a_time(executing_, std::try_to_lock);
  if (!one_at_a_time) return fail(Reason::robot_locked, "another order is in execution");
  const auto since = [&] {
    const std::lock_guard lock(guard_);
    return machine_.redeem(token, order, Clock::now());
  }();
  if (!since) return tl::unexpected<Failure>(since.error());
  if (order.model != config_.model.name)
    return fail(Reason::bad_value,
                "the order is for a " + order.model + ", the robot is a " + config_.model.name);
  if (order.corrections.most > 0 && !measure)
    return fail(Reason::bad_value, "an order with corrections requires a tracker");
  const Watch watched = watch ? watch : [] { return Expected<void>(); };
  const auto ended = run(order, *since, watched);
  if (!ended) return tl::unexpected<Failure>(ended.error());
  const auto by_robot = [&]() -> Expected<ToolMeasurement> {
    return ToolMeasurement{ended->base_from_tcp, order.waypoints.back().base_from_tcp};
  };
  auto misses = follow_target(order.corrections, order.corrections.most > 0 ? measure : Measure(by_robot),
                              [&](const geometry::RigidTransform& tcp_from_new) {
                                return correct(order, *since, tcp_from_new, watched);
                              });
  if (!misses) {
    const std::lock_guard lock(guard_);
    machine_.stop_order(*since, misses.error());
    changed();
  }
  return misses;
}

}  // namespace helicarm::robot
