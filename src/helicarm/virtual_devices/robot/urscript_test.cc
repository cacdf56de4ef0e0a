// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/urscript.h"

#include <gtest/gtest.h>

namespace helicarm::robot {
namespace {

/// Records calls; a motion lasts until `moving_` is reset.
struct CallRecorder : UrScriptHost {
  bool moving() const override { return moving_; }
  void start_motion(const std::string& command, const std::vector<UrValue>&,
                    const std::map<std::string, double>& named) override {
    log += command + " ";
    speed = named.contains("v") ? named.at("v") : 0;
    moving_ = true;
  }
  UrValue call(const std::string& name, const std::vector<UrValue>& arguments) override {
    if (name == "note") return notes.push_back(note = arguments.at(0)), UrValue{};
    if (name == "input") return {input};
    throw BadInput(Reason::unsupported, "function " + name + " is not defined");
  }
  bool moving_ = false;
  double speed = 0, input = 0;
  UrValue note;
  std::vector<UrValue> notes;
  std::string log;
};

Reason refused(const std::string& text) {
  auto script = UrScript::parse(text);
  if (!script) return script.error().reason;
  CallRecorder recorder;
  const auto step = script->step(recorder);
  return step ? Reason::usage : step.error().reason;
}

TEST(UrScript, ArithmeticAndBranches) {
  auto script = UrScript::parse(
      "def f():\n  x = 2 * (1 + 3) - -1\n  if x == 9:\n    note([x, x - 1, 0.5])\n  else:\n    note(0)\n  "
      "end\nend\n");
  ASSERT_TRUE(script) << script.error().message;
  CallRecorder recorder;
  EXPECT_FALSE(*script->step(recorder));
  EXPECT_EQ(recorder.note, (UrValue{9, 8, 0.5}));
}

TEST(UrScript, AndBindsTighterThanOrAndNotTightest) {
  auto script = UrScript::parse(
      "def f():\n  no = False\n  note([1 == 1 or no and no, not no and 2 > 1, not (1 == 1 or no), no or not "
      "1 < 2])\n"
      "  order = 3\n  android = 4\n  note([order + android, 0])\nend\n");
  ASSERT_TRUE(script) << script.error().message;
  CallRecorder recorder;
  EXPECT_FALSE(*script->step(recorder));
  EXPECT_EQ(recorder.notes, (std::vector<UrValue>{{1, 1, 0, 0}, {7, 0}}));
}

TEST(UrScript, ThreadMovesWhileTheProgramWatches) {
  auto script = UrScript::parse(
      "def f():\n  thread move():\n    movel(p[0,0,0,0,0,0], a=1, v=0.25)\n    note(7)\n  end\n"
      "  mover = run move()\n  while input() == 0:\n    sync()\n  end\n  kill mover\n  stopj(4)\nend\n");
  ASSERT_TRUE(script) << script.error().message;
  CallRecorder recorder;
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(*script->step(recorder));
  EXPECT_EQ(recorder.log, "movel ");
  EXPECT_EQ(recorder.speed, 0.25);
  recorder.input = 1;
  EXPECT_TRUE(*script->step(recorder));
  EXPECT_EQ(recorder.log, "movel stopj ");
  recorder.moving_ = false;
  EXPECT_FALSE(*script->step(recorder));
  EXPECT_TRUE(recorder.note.empty());
}

TEST(UrScript, UnknownStatementsAreRefused) {
  EXPECT_EQ(refused("movej([0])\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  note(1)\n"), Reason::truncated);
  EXPECT_EQ(refused("def f():\nend\nnote(1)\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  launch()\nend\n"), Reason::unsupported);
  EXPECT_EQ(refused("def f():\n  note(y)\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  note(1;2)\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  import os\nend\n"), Reason::unsupported);
  EXPECT_EQ(refused("def f():\n  else:\n  end\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  while True:\n  end\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  x = run nothing()\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused("def f():\n  note(" + std::string(5000, '(') + ")\nend\n"), Reason::bad_value);
  EXPECT_EQ(refused(std::string(70000, ' ')), Reason::bad_size);
}

TEST(UrScript, NumberThatOverflowsIsNotFinite) {
  for (const char* overflow : {"1e308 * 10", "1e308 + 1e308", "-1e308 - 1e308", "1e308 * 10 - 1e308 * 10"})
    EXPECT_EQ(refused(std::string("def f():\n  x = ") + overflow + "\nend\n"), Reason::not_finite)
        << overflow;
}

}  // namespace
}  // namespace helicarm::robot
