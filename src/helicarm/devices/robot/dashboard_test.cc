// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/dashboard.h"

#include <gtest/gtest.h>

namespace helicarm::robot {
namespace {

TEST(Dashboard, LinesAreTakenOneByOneWithoutControlCharacters) {
  std::string received = "Connected\r\nRobotmode: \x1b[2J\nrest";
  EXPECT_EQ(take_dashboard_line(received).value(), "Connected");
  EXPECT_EQ(take_dashboard_line(received).value(), "Robotmode: ?[2J");
  EXPECT_EQ(take_dashboard_line(received).value(), std::nullopt);
  EXPECT_EQ(received, "rest");
}

TEST(Dashboard, LineOfOverAThousandCharactersIsRefused) {
  for (const char* end : {"", "\n"}) {
    std::string received = std::string(1001, 'x') + end;
    EXPECT_EQ(take_dashboard_line(received).error().reason, Reason::bad_size);
  }
}

TEST(Dashboard, AnswerToAnotherCommandIsRefused) {
  EXPECT_EQ(checked_answer(DashboardCommand::remote_control, "false").value(), "false");
  EXPECT_EQ(checked_answer(DashboardCommand::stop, "true").error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::robot
