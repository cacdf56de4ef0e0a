// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/script.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/devices/robot/robot_state.h"

namespace helicarm {
namespace {

std::string written(const RigidTransform& transform) {
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

std::string script_of(const RobotOrder& order, const RobotModel& model, std::int32_t number) {
  return fmt::format(
      R"(def helicarm_order():
  set_tcp({tool})
  set_payload({payload:.6f})
  write_output_integer_register(0, {begun})
  thread move():
{moves}    write_output_integer_register(0, {done})
  end
  mover = run move()
  beat = read_input_integer_register(24)
  silent = 0
  while read_output_integer_register(0) != {done}:
    sync()
    heard = read_input_integer_register(24)
    if heard == beat:
      silent = silent + 1
    else:
      beat = heard
      silent = 0
    end
    if heard < 0:
      silent = {patience}
    end
    if silent >= {patience}:
      kill mover
      stopj({deceleration:.6f})
      write_output_integer_register(0, {too_silent})
      halt
    end
  end
end
)",
      fmt::arg("tool", written(order.tool.flange_from_tcp)), fmt::arg("payload", order.tool.payload_kg),
      fmt::arg("begun", progress_of(number, ScriptStage::begun)), fmt::arg("moves", moves_of(order)),
      fmt::arg("done", progress_of(number, ScriptStage::done)),
      fmt::arg("patience", static_cast<int>(std::lround(silence_s * model.rate_hz))),
      fmt::arg("deceleration", stop_rad_s2),
      fmt::arg("too_silent", progress_of(number, ScriptStage::silent)));
}

}  // namespace helicarm
