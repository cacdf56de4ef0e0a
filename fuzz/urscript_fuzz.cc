// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/virtual_devices/robot/urscript.h"
#include "helicarm/virtual_devices/robot/virtual_controller.h"
#include "target.h"

namespace helicarm::fuzz {

namespace {
constexpr robot::OrderNumber number{7, 1};
}  // namespace

void run(std::string_view bytes) {
  const int beats = static_cast<int>(Choices(bytes).byte());
  robot::VirtualController controller(robot::ur5(), robot::drill(), robot::resting_joints());
  controller.run_script(std::string(bytes));
  constexpr int steps = 60;
  for (int i = 0; i < steps; ++i) {
    const robot::ScriptReport script = controller.state().script;
    controller.set_heartbeat({i < beats ? script.tick : robot::stop_beat, number});
    controller.step();
    const robot::RobotState state = controller.state();
    check(state.joints.allFinite() && state.joint_speeds.allFinite(), "the joints stay finite");
    const robot::Joints& farthest = robot::ur5().farthest;
    check((state.joints.cwiseAbs() - farthest).maxCoeff() < 0.1, "the joints stay within their limits");
  }
}

std::vector<std::string> seeds() {
  const char many = '\x7f';
  return {many + robot::script_of(robot::planned(), robot::ur5(), number),
          '\3' + robot::script_of(robot::planned(), robot::ur5(), robot::OrderNumber{}),
          many + std::string(
                     "def f():\n  x = 2 * (1 + 3) - -1\n  if x == 9:\n    movej([0.2, -1.7, -1.5, -1.4, 1.5, "
                     "0.4], a=1, v=0.5)\n  else:\n    set_payload(0)\n  end\n  global y = [1, x]\nend\n"),
          many + std::string("def f():\n  while True:\n    sync()\n  end\nend\n")};
}

}  // namespace helicarm::fuzz
