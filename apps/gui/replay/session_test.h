// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include <gtest/gtest.h>

#include "helicarm/operation/plan.h"
#include "helicarm/operation/seen_poses.h"
#include "helicarm/operation/session_log.h"

/// A short operation's record for tests, with one record of each kind.
namespace helicarm::gui {

inline constexpr std::array<std::string_view, 15> session_kinds{
    "session",  "plan",  "refused",   "exposure",  "exposure", "case",   "result", "poses",
    "hand_eye", "order", "confirmed", "navigated", "outcome",  "halted", "end"};

inline Json window_with(double femur_x) {
  operation::PoseWindow window{10, 0.5, {}};
  window.samples["femur"] = {{9.8, 0, 9.8, {Eigen::Matrix3d::Identity(), {0, 0, 0}}},
                             {10.2, 0, 10.2, {Eigen::Matrix3d::Identity(), {femur_x, 0, 0}}}};
  window.samples["tibia"] = {};
  return operation::to_json(window);
}

inline void write_session(const std::filesystem::path& folder) {
  const auto session = operation::SessionLog::open(folder / "session.log").value();
  const auto add = [&](const char* kind, Json content) {
    ASSERT_TRUE(session->append(kind, std::move(content)));
  };
  const Json end = {{"across_mm", {0.3, 0.4}},
                    {"covariance_mm2", {{0.05, 0}, {0, 0.06}}},
                    {"distance_mm", 0.5},
                    {"predicted_mm", 0.6}};
  add("plan", operation::to_json(operation::OperationPlan{}));
  add("refused", {{"view", "AP"}, {"picture", "00"}, {"why", "stale_pose"}});
  add("exposure", {{"view", "AP"}, {"picture", "01"}, {"window", window_with(1)}, {"poses", Json::object()}});
  add("exposure", {{"view", "LAT"}, {"picture", "02"}, {"window", window_with(2)}, {"poses", nullptr}});
  add("case", {{"folder", "case-1"}});
  add("result", {{"folder", "case-1"}, {"digest", "03"}});
  add("poses", {{"why", "plan"}, {"window", window_with(3)}});
  add("hand_eye", {{"pairs", Json::array()}, {"found", {{"rms_mm", 0.2}}}});
  add("order", {{"name", "femur"}, {"waypoints", Json::array()}});
  add("confirmed", {{"order", "femur"}, {"digest", "04"}, {"by", "tester"}});
  add("navigated", {{"tunnel", "femur"},
                    {"loop",
                     {{{"distance_mm", 1.5}, {"turn_deg", 1.0}, {"sigma_mm", 0.1}},
                      {{"distance_mm", 0.25}, {"turn_deg", 0.1}, {"sigma_mm", 0.1}}}}});
  add("outcome", {{"tunnel", "femur"}, {"start", end}, {"end", end}});
  add("halted", {{"order", "tibia"}, {"why", "robot_stopped"}, {"message", "stopped by a person"}});
  add("end", Json::object());
}

}  // namespace helicarm::gui
