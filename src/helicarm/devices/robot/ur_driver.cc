// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/ur_driver.h"

#include <optional>
#include <utility>

#include <fmt/format.h>

#include "helicarm/devices/robot/dashboard.h"
#include "helicarm/devices/robot/rtde_client.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/devices/robot/timed_socket.h"

namespace helicarm::robot {
namespace {

using Milliseconds = std::chrono::milliseconds;

/// Time in which the kernel accepts a script: it fits into the buffer of a new socket.
constexpr Milliseconds handing_over{50};

/// A robot may discard a script whose sender disconnects; closing the socket withdraws a script not yet read.
class ScriptChannel : public OrderChannel {
 public:
  ScriptChannel(TimedSocket socket, RobotModel model)
      : socket_(std::move(socket)), model_(std::move(model)) {}

  Expected<void> send(const RobotOrder& order, OrderNumber number) override {
    return socket_.send(script_of(order, model_, number), handing_over);
  }

 private:
  TimedSocket socket_;
  RobotModel model_;
};

class UrDriver : public RobotDriver {
 public:
  explicit UrDriver(RobotAddress address) : address_(std::move(address)) {}

  void start(RobotListener listener) override {
    client_.emplace(RtdeOptions{.address = address_.address,
                                .port = address_.rtde_port,
                                .rate_hz = address_.rate_hz > 0 ? address_.rate_hz : address_.model.rate_hz,
                                .commands = !address_.reads_only,
                                .handshake_s = address_.lost_s,
                                .silence_s = address_.lost_s},
                    std::move(listener));
  }

  Expected<void> check_remote_control() override {
    const auto remote = ask(DashboardCommand::remote_control);
    if (remote && *remote == "false")
      return fail(Reason::robot_locked, "the robot is in local mode: switch it to remote control");
    // A CB3 has no remote mode and rejects the query.
    if (!remote && remote.error().reason != Reason::bad_value) return tl::unexpected<Failure>(remote.error());
    return {};
  }

  Expected<void> release_protective_stop() override {
    const auto answer = ask(DashboardCommand::unlock_protective_stop);
    if (!answer) return fail(Reason::robot_stopped, answer.error().message);
    return {};
  }

  Expected<std::unique_ptr<OrderChannel>> open_channel() override {
    return TimedSocket::connect(address_.address, address_.script_port, Milliseconds(1000))
        .map([&](TimedSocket socket) -> std::unique_ptr<OrderChannel> {
          return std::make_unique<ScriptChannel>(std::move(socket), address_.model);
        });
  }

  std::vector<Warning> advisories(const ControllerVersion& v) const override {
    if (v.major != 5 || std::pair(v.minor, v.bugfix) >= std::pair(25u, 1u)) return {};
    return {{Reason::unsupported,
             fmt::format(
                 "PolyScope {}.{}.{} allows others to run commands on the robot: update to 5.25.1 or later",
                 v.major, v.minor, v.bugfix)}};
  }

 private:
  Expected<std::string> ask(DashboardCommand command) const {
    return ask_dashboard(address_.address, address_.dashboard_port, command);
  }

  RobotAddress address_;
  std::optional<RtdeClient> client_;
};

}  // namespace

std::unique_ptr<RobotDriver> ur_driver(const RobotAddress& address) {
  return std::make_unique<UrDriver>(address);
}

}  // namespace helicarm::robot
