// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include <gtest/gtest.h>

#include "helicarm/operation/session_records.h"

/// A short operation's record for tests, with one record of each kind.
namespace helicarm::gui {

inline constexpr std::array<std::string_view, 15> session_kinds{
    "session",  "plan",  "refused",   "exposure",  "exposure", "case",   "result", "poses",
    "hand_eye", "order", "confirmed", "navigated", "outcome",  "halted", "end"};

inline operation::PoseWindow window_with(double femur_x) {
  operation::PoseWindow window{10, 0.5, {}};
  window.samples["femur"] = {{9.8, 0, 9.8, {Eigen::Matrix3d::Identity(), {0, 0, 0}}},
                             {10.4, 0, 10.4, {Eigen::Matrix3d::Identity(), {femur_x, 0, 0}}}};
  window.samples["tibia"] = {};
  return window;
}

inline robot::RobotOrder order_to(const char* tunnel) {
  robot::RobotOrder order;
  order.name = tunnel;
  order.model = "UR5";
  order.tool.flange_from_tcp = {Eigen::Matrix3d::Identity(), {0, 0, 150}};
  order.waypoints = {{{Eigen::Matrix3d::Identity(), {400, 0, 300}}, 10, 100}};
  return order;
}

inline tracker::HandEye found_hand_eye() {
  tracker::HandEye found;
  found.flange_from_marker = found.tracker_from_base = {Eigen::Matrix3d::Identity(), {1, 2, 3}};
  found.covariance.setIdentity();
  found.rms_mm = 0.2;
  return found;
}

inline void write_session(const std::filesystem::path& folder) {
  const auto session = operation::SessionLog::open(folder / "session.log").value();
  const auto add = [&](const operation::Record& record) {
    ASSERT_TRUE(session->append(std::string(operation::kind_of(record)), operation::content_of(record)));
  };
  using namespace operation::record;
  const operation::EndMiss end{{0.3, 0.4}, Eigen::Vector2d(0.05, 0.06).asDiagonal().toDenseMatrix()};
  operation::OperationPlan plan;
  plan.robot.tool.flange_from_tcp = order_to("femur").tool.flange_from_tcp;
  add(Plan{plan});
  add(Refused{"AP", "00", "stale_pose", {}});
  add(Exposure{"AP", "01", {}, {}, window_with(1), guidance::Poses{}});
  add(Exposure{"LAT", "02", {}, {}, window_with(2), {}});
  add(CaseBegun{"case-1", Json::object(), {}, {}});
  add(Measured{"case-1", "03", {}});
  add(Poses{Look::plan, window_with(3)});
  add(HandEye{{}, found_hand_eye()});
  add(Order::of(order_to("femur")));
  add(Confirmed{"femur", "04", "tester"});
  add(Navigated{"femur", {{1.5, 1, 0.1}, {0.25, 0.1, 0.1}}});
  add(Outcome{"femur", end, end});
  add(Halted{"tibia", "robot_stopped", "stopped by a person", {}});
  add(End{});
}

}  // namespace helicarm::gui
