// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/arm_driver.h"

#include <condition_variable>
#include <mutex>
#include <thread>

#include "helicarm/devices/robot/script.h"
#include "helicarm/virtual_devices/robot/virtual_arm.h"

namespace helicarm::robot {

/// Arm and running order; members are used under the mutex.
struct ArmDriver::Controller {
  explicit Controller(const ArmOptions& options)
      : model(options.model), tool(options.tool), arm(options.model, options.joints) {}

  enum class Phase { none, arrived, waiting, moving, braking };

  int periods(double s) const { return static_cast<int>(std::lround(s * model.rate_hz)); }
  RobotState state() const;
  void take(const RobotOrder& robot_order, OrderNumber its_number);
  void step(const Heartbeat& heard);
  bool permits(const Heartbeat& heard) const;
  void advance();
  void stop_protectively();

  mutable std::mutex mutex;
  const RobotModel model;
  const RobotTool tool;
  VirtualArm arm;
  bool local = false, protective = false, cut = false;
  double time_s = 0;
  RobotOrder order;
  OrderNumber number;  ///< of `order`
  Phase phase = Phase::none;
  std::size_t next = 0;  ///< waypoint
  int waited = 0;        ///< periods since it arrived
  ScriptReport report;
};

RobotState ArmDriver::Controller::state() const {
  RobotState state;
  state.time_s = time_s;
  state.joints = arm.joints();
  state.joint_speeds = arm.joint_speeds();
  state.base_from_tcp = base_from_flange(model, arm.joints()) * tool.flange_from_tcp;
  state.flange_from_tcp = tool.flange_from_tcp;
  state.payload_kg = tool.payload_kg;
  state.safety_mode = protective ? SafetyMode::protective_stop : SafetyMode::normal;
  state.runtime = phase == Phase::none ? RuntimeState::stopped : RuntimeState::playing;
  state.script = report;
  return state;
}

/// An order with the number of the last one has begun before.
void ArmDriver::Controller::take(const RobotOrder& robot_order, OrderNumber its_number) {
  if (cut || local || protective || phase == Phase::moving || phase == Phase::braking ||
      its_number == report.order)
    return;
  order = robot_order;
  number = its_number;
  phase = Phase::arrived;
  next = 0;
  waited = 0;
}

bool ArmDriver::Controller::permits(const Heartbeat& heard) const {
  return heard.order == number && heard.beat > 0 && heard.beat <= report.tick &&
         report.tick - heard.beat < periods(silence_s);
}

void ArmDriver::Controller::step(const Heartbeat& heard) {
  time_s += 1 / model.rate_hz;
  if (phase == Phase::none) return;
  if (phase == Phase::arrived) {
    if (heard.order == number) {
      report = {ScriptStage::waiting, number, 0};
      phase = Phase::waiting;
    } else if (++waited > periods(longest_wait_s)) {
      phase = Phase::none;
    }
    return;
  }
  ++report.tick;
  if (phase == Phase::waiting) {
    if (permits(heard)) {
      report.stage = ScriptStage::begun;
      phase = Phase::moving;
    } else if (heard.order != number || report.tick > periods(longest_wait_s)) {
      phase = Phase::none;
      return;
    }
  } else if (phase == Phase::moving && !permits(heard)) {
    arm.brake(stop_rad_s2);
    phase = Phase::braking;
  }
  advance();
}

void ArmDriver::Controller::advance() {
  if (phase == Phase::moving && !arm.moving()) {
    if (next == order.waypoints.size()) {
      report.stage = ScriptStage::done;
      phase = Phase::none;
      return;
    }
    const Waypoint& to = order.waypoints[next++];
    if (!arm.move_linear(to.base_from_tcp, tool.flange_from_tcp, to.speed_mm_s, to.acceleration_mm_s2))
      return stop_protectively();
  }
  if (!arm.step(1 / model.rate_hz, 1)) return stop_protectively();
  if (phase == Phase::braking && !arm.moving()) {
    report.stage = ScriptStage::stopped;
    phase = Phase::none;
  }
}

void ArmDriver::Controller::stop_protectively() {
  protective = true;
  if (phase == Phase::moving) {
    arm.brake(stop_rad_s2);
    phase = Phase::braking;
  }
}

struct ArmDriver::Channel : OrderChannel {
  explicit Channel(std::shared_ptr<Controller> of) : controller(std::move(of)) {}
  ~Channel() override {
    const std::lock_guard lock(controller->mutex);
    if (controller->number == sent && controller->phase == Controller::Phase::arrived)
      controller->phase = Controller::Phase::none;
  }

  Expected<void> send(const RobotOrder& order, OrderNumber number) override {
    const std::lock_guard lock(controller->mutex);
    sent = number;
    controller->take(order, number);
    return {};
  }

  std::shared_ptr<Controller> controller;
  OrderNumber sent;
};

/// Calls the listener without the controller's mutex, which a channel may want under the link's lock.
class ArmDriver::Stepping {
 public:
  Stepping(std::shared_ptr<Controller> controller, RobotListener listener, double period_s)
      : controller_(std::move(controller)),
        listener_(std::move(listener)),
        period_(std::chrono::duration<double>(period_s)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

 private:
  void run(const std::stop_token& stop) {
    bool connected = false;
    Heartbeat answer;
    while (!stop.stop_requested()) {
      const auto [state, cut] = [&] {
        const std::lock_guard lock(controller_->mutex);
        controller_->step(answer);
        return std::pair(controller_->state(), controller_->cut);
      }();
      if (cut && connected) listener_.lost({Reason::not_connected, "the arm's cable is disconnected"});
      if (!cut && !connected) listener_.connected({});
      connected = !cut;
      if (connected) answer = listener_.state(state);
      std::unique_lock lock(pause_);
      ended_.wait_for(lock, stop, period_, [] { return false; });
    }
  }

  std::shared_ptr<Controller> controller_;
  RobotListener listener_;
  std::chrono::duration<double> period_;
  std::mutex pause_;
  std::condition_variable_any ended_;
  std::jthread thread_;
};

ArmDriver::ArmDriver(const ArmOptions& options)
    : controller_(std::make_shared<Controller>(options)), speed_up_(options.speed_up) {}
ArmDriver::~ArmDriver() = default;

void ArmDriver::start(RobotListener listener) {
  stepping_ = std::make_unique<Stepping>(controller_, std::move(listener),
                                         1 / (controller_->model.rate_hz * speed_up_));
}

Expected<void> ArmDriver::check_remote_control() {
  const std::lock_guard lock(controller_->mutex);
  if (controller_->local) return fail(Reason::robot_locked, "the arm is in local mode");
  return {};
}

Expected<void> ArmDriver::release_protective_stop() {
  set_protective_stop(false);
  return {};
}

Expected<std::unique_ptr<OrderChannel>> ArmDriver::open_channel() {
  return std::make_unique<Channel>(controller_);
}

void ArmDriver::set_local_mode(bool on) {
  const std::lock_guard lock(controller_->mutex);
  controller_->local = on;
}

void ArmDriver::set_protective_stop(bool on) {
  const std::lock_guard lock(controller_->mutex);
  if (on)
    controller_->stop_protectively();
  else
    controller_->protective = false;
}

void ArmDriver::cut_cable(bool on) {
  const std::lock_guard lock(controller_->mutex);
  controller_->cut = on;
}

RobotState ArmDriver::state() const {
  const std::lock_guard lock(controller_->mutex);
  return controller_->state();
}

bool ArmDriver::moving() const {
  const std::lock_guard lock(controller_->mutex);
  return controller_->arm.moving();
}

}  // namespace helicarm::robot
