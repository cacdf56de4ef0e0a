// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "helicarm/devices/robot/link_model_test.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/virtual_devices/robot/virtual_controller.h"

namespace helicarm::robot {
namespace {

/// The model's script and the real one agree in every period for any register values.
TEST(LinkModel, ScriptModelAgreesWithTheScript) {
  RobotOrder order{"down", ur5().name, drill(), resting_joints(), {}, {}, {}};
  geometry::RigidTransform aside = resting_state().base_from_tcp;
  aside.translation.y() += 2;
  order.waypoints = {{aside, 50, 1200}};
  const OrderNumber number{3, 4};
  int moved = 0, done = 0, stopped = 0;
  for (std::uint64_t trial = 0; trial < 300; ++trial) {
    RandomStream random(14, 402, trial);
    VirtualController controller(ur5(), drill(), resting_joints());
    ScriptModel model(number, {});
    ScriptReport report;
    const bool calm = trial % 2 == 0;
    controller.run_script(script_of(order, ur5(), number));
    for (int period = 0; period < 150; ++period) {
      const std::int32_t tick = report.tick;
      Heartbeat heartbeat{tick > 0 ? tick : stop_beat, number};
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.order.count -= 1;
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.order.session += 1;
      if (random.uniform() < (calm ? 0.01 : 0.1))
        heartbeat.beat = tick - 12 + static_cast<std::int32_t>(random.index(16));
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.beat = stop_beat;
      controller.set_heartbeat(heartbeat);
      const bool rests = !controller.moving();
      controller.step();
      if (!model.ended()) model.step(heartbeat, report, rests);
      const RobotState state = controller.state();
      ASSERT_EQ(controller.script_error(), "");
      ASSERT_EQ(state.script.stage, report.stage) << trial << ", period " << period;
      ASSERT_EQ(state.script.tick, report.tick) << trial << ", period " << period;
      ASSERT_EQ(state.script.order, report.order) << trial << ", period " << period;
      ASSERT_EQ(state.runtime == RuntimeState::playing, !model.ended()) << trial << ", period " << period;
      moved += model.begins();
    }
    done += report.stage == ScriptStage::done;
    stopped += report.stage == ScriptStage::stopped;
    EXPECT_EQ(controller.moving(), false);
  }
  EXPECT_GT(moved, 50);
  EXPECT_GT(done, 20);
  EXPECT_GT(stopped, 20);
}

}  // namespace
}  // namespace helicarm::robot
