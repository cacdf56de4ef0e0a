// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/script.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {
namespace {

std::string written(const geometry::RigidTransform& transform) {
  const UrPose p = ur_pose(transform);
  return fmt::format("p[{:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}]", p[0], p[1], p[2], p[3], p[4], p[5]);
}

std::string moves_of(const RobotOrder& order) {
  std::string moves;
  for (const Waypoint& waypoint : order.waypoints)
    moves += fmt::format("    movel({}, a={:.6f}, v={:.6f})\n", written(waypoint.base_from_tcp),
                         waypoint.acceleration_mm_s2 / mm_per_m, waypoint.speed_mm_s / mm_per_m);
  return moves;
}

}  // namespace

std::string script_of(const RobotOrder& order, const RobotModel& model, OrderNumber number) {
  const auto periods = [&](double s) { return static_cast<int>(std::lround(s * model.rate_hz)); };
  return fmt::format(
      R"(def helicarm_order():
  thread move():
{moves}    write_output_integer_register(0, {done})
  end
  if read_output_integer_register(1) == {session} and read_output_integer_register(2) == {count}:
    halt
  end
  waited = 0
  while read_input_integer_register(25) != {session} or read_input_integer_register(26) != {count}:
    if waited > {longest_wait}:
      halt
    end
    waited = waited + 1
    sync()
  end
  write_output_integer_register(0, {none})
  write_output_integer_register(1, {session})
  write_output_integer_register(2, {count})
  write_output_integer_register(3, 0)
  write_output_integer_register(0, {waiting})
  tick = 0
  moving = False
  while read_output_integer_register(0) != {done}:
    sync()
    tick = tick + 1
    write_output_integer_register(3, tick)
    heard = read_input_integer_register(24)
    ours = read_input_integer_register(25) == {session} and read_input_integer_register(26) == {count}
    live = heard > 0 and heard <= tick and tick - heard < {patience}
    if ours and live:
      if not moving:
        moving = True
        set_tcp({tool})
        set_payload({payload:.6f})
        write_output_integer_register(0, {begun})
        mover = run move()
      end
    else:
      if moving:
        kill mover
        stopj({deceleration:.6f})
        write_output_integer_register(0, {stopped})
        halt
      end
      if not ours or tick > {longest_wait}:
        halt
      end
    end
  end
end
)",
      fmt::arg("moves", moves_of(order)), fmt::arg("session", number.session),
      fmt::arg("count", number.count), fmt::arg("none", static_cast<int>(ScriptStage::none)),
      fmt::arg("waiting", static_cast<int>(ScriptStage::waiting)),
      fmt::arg("begun", static_cast<int>(ScriptStage::begun)),
      fmt::arg("stopped", static_cast<int>(ScriptStage::stopped)),
      fmt::arg("done", static_cast<int>(ScriptStage::done)), fmt::arg("patience", periods(silence_s)),
      fmt::arg("longest_wait", periods(longest_wait_s)), fmt::arg("deceleration", stop_rad_s2),
      fmt::arg("tool", written(order.tool.flange_from_tcp)), fmt::arg("payload", order.tool.payload_kg));
}

}  // namespace helicarm::robot
