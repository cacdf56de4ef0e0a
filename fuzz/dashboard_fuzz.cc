// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "helicarm/core/text.h"
#include "helicarm/devices/robot/dashboard.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/virtual_devices/robot/virtual_controller.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  Choices choices(bytes);
  const auto command = static_cast<robot::DashboardCommand>(choices.byte() % 10);
  const std::size_t segment = 1 + choices.byte();
  robot::VirtualController controller(robot::ur5(), robot::drill(), robot::resting_joints());
  std::string received;
  while (!bytes.empty()) {
    received += bytes.substr(0, segment);
    bytes.remove_prefix(std::min(segment, bytes.size()));
    for (;;) {
      const auto line = robot::take_dashboard_line(received);
      if (!line) return;
      if (!*line) break;
      check((*line)->size() <= 1000 && !holds_control_character(**line),
            "a line is short and has no control characters");
      const auto answer = checked_answer(command, **line);
      check(!answer || *answer == **line, "an answer is passed on unchanged");
      check(!controller.dashboard(**line).empty(), "the virtual robot answers each command");
    }
    check(received.size() <= 1000 + segment, "at most one line is buffered");
  }
}

std::vector<std::string> seeds() {
  const std::vector<std::string> lines = {
      "Connected: Universal Robots Dashboard Server\n",
      "Robotmode: RUNNING\n",
      "Safetymode: NORMAL\r\n",
      "PLAYING helicarm\n",
      "STOPPED helicarm\n",
      "true\n",
      "false\n",
      "URSoftware 5.25.1.0\n",
      "Stopped\n",
      "closing safety popup\n",
      "Protective stop releasing\n",
      "Powering on\n",
      "Brake releasing\n",
      "robotmode\nsafetymode\nprogramState\nis in remote control\nPolyscopeVersion\nstop\nclose safety "
      "popup\n"
      "unlock protective stop\npower on\nbrake release\nrestart safety\nrunning\nsafetystatus\n"};
  std::vector<std::string> all;
  for (std::size_t i = 0; i < lines.size(); ++i)
    all.push_back(std::string{static_cast<char>(i % 10), '\x0f'} + lines[0] + lines[i]);
  return all;
}

}  // namespace helicarm::fuzz
