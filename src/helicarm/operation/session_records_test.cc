// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/session_records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::operation {
namespace session_records_test {

using testing::HasSubstr;

Expected<Record> read(const char* kind, Json content) {
  return record_from({7, 0, kind, std::move(content)}, "/somewhere");
}

geometry::RigidTransform pose(double x) {
  return {Eigen::AngleAxisd(0.1 * x, Eigen::Vector3d::UnitX()).toRotationMatrix(), {x, 1 / 3.0, -2}};
}

PoseWindow window() {
  PoseWindow window{10, 0.5, {}};
  window.samples["femur"] = {{9.8, 0.1, 9.9, pose(1)}};
  window.samples["tibia"] = {};
  return window;
}

robot::RobotOrder order() {
  robot::RobotOrder order;
  order.name = "femur";
  order.model = "UR5";
  order.start << 0.1, -1.2, 1.3, 0.4, -0.5, 1.6;
  order.tool.flange_from_tcp = pose(3);
  order.waypoints = {{pose(4), 10, 100}};
  return order;
}

OperationPlan plan() {
  OperationPlan plan;
  plan.tunnels = {{"femur", "femur", "FS", "FE", TunnelEnd::end}};
  plan.robot.tool = {pose(2), 1.2};
  return plan;
}

Guidance off_target() {
  Guidance guidance;
  guidance.aim = TunnelAim{1, 2, 3, 4, 0.1, 0.2, 0.3, {1, 0, 0}, Eigen::Vector3d::UnitZ()};
  guidance.aim->errors = AimErrors{{0.01, 0.02}, {0.03, 0.04}, {0.05, 0.06}, {0.07, 0.08}};
  guidance.bone_moved = Motion{0.1, 0.2};
  guidance.age_s = 0.05;
  guidance.why_not = Failure{Reason::off_target, "1 mm off"};
  return guidance;
}

std::vector<Record> one_of_each_kind() {
  using namespace record;
  guidance::Poses poses;
  poses.tracker_from_calibrator = pose(5);
  poses.tracker_from_bone = {{"femur", pose(6)}};
  const Digests files{{"a.dcm", "00"}};
  tracker::HandEye found;
  found.flange_from_marker = pose(7), found.tracker_from_base = pose(8);
  found.covariance = Eigen::Matrix<double, 12, 12>::Identity() / 3;
  const EndMiss miss{{0.3, 0.41}, Eigen::Vector2d(0.05, 0.06).asDiagonal().toDenseMatrix()};
  return {Session{"helicarm-session/1", "0.1.0"},
          Plan{plan()},
          Models{"models", files},
          Exposure{"AP", "01", "inbox", 0.2, window(), poses},
          Refused{"AP", "01", "stale_pose", {{"held_s", 2.5}}},
          Touched{"divot", window(), {1, 2, 1 / 3.0}},
          CaseBegun{"case-1", {{"format", "helicarm-case/2"}}, files, "femur"},
          Measured{"case-1", "03", files},
          Registered{"case-1/registration", "04", files, {{"femur", pose(10)}}},
          RegistrationConfirmed{"04", "tester"},
          Poses{Look::hand_eye, window()},
          Tour{pose(9)},
          HandEye{{{pose(1), pose(2)}}, found},
          Withdraw{"05", {pose(3), pose(4)}},
          Robot{robot::Joints::Constant(1 / 3.0)},
          Order::of(order()),
          Preview{"femur", files},
          Confirmed{"femur", "06", "tester"},
          CarriedOut{{"femur", "06", "tester"}},
          Halted{"femur", "robot_stopped", "stopped", {{"x_mm", 1}}},
          Replanned{"femur", 2, "stale_pose", "tester"},
          Navigated{"femur", {{1.5, 1, 0.1}}},
          Guide{"femur", 0.15, window()},
          Guided{"femur", window(), off_target()},
          GuidanceEnded{"femur", GuidanceEndedBy::plan_stale},
          Outcome{"femur", miss, miss, guidance::TipDepth{1.8, 0.23, 1}},
          End{"interrupted", "stopped"}};
}

TEST(SessionRecords, EveryKindIsReadAsItWasWrittenToTheBit) {
  const std::vector<Record> records = one_of_each_kind();
  EXPECT_EQ(records.size(), std::variant_size_v<Record>);
  for (const Record& written : records) {
    const auto again = parse_json(content_of(written).dump(), "log").value();
    const auto back = read(std::string(kind_of(written)).c_str(), again);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->index(), written.index());
    EXPECT_EQ(content_of(*back), content_of(written)) << kind_of(written);
  }
}

TEST(SessionRecords, AFieldThatIsMissingWrongOrUnknownIsNamed) {
  for (const Record& written : one_of_each_kind()) {
    const std::string kind(kind_of(written));
    Json more = content_of(written);
    more["invented"] = 1;
    EXPECT_FALSE(read(kind.c_str(), more)) << kind;
    EXPECT_FALSE(read(kind.c_str(), Json::array())) << kind;
  }
  EXPECT_THAT(read("exposure", {{"view", 7}}).error().message, HasSubstr("record 7: \"view\""));
  EXPECT_EQ(read("dance", Json::object()).error().reason, Reason::unsupported);
}

TEST(SessionRecords, AFigureThatContradictsTheOthersIsRefused) {
  const EndMiss miss{{0.3, 0.4}, Eigen::Matrix2d::Identity()};
  Json content = content_of(record::Outcome{"femur", miss, miss});
  content["end"]["distance_mm"] = 0.4;
  EXPECT_THAT(read("outcome", content).error().message, HasSubstr("distance_mm"));
}

TEST(SessionRecords, EarlierVersionsAreRead) {
  Json exposure = content_of(record::Exposure{"AP", "01", {}, {}, window(), guidance::Poses{}});
  const Json rows = content_of(record::Tour{pose(6)})["base_from_tcp"];
  exposure["poses"] = {
      {"tracker_from_calibrator", rows}, {"tracker_from_femur", rows}, {"tracker_from_tibia", nullptr}};
  const auto read_back = read("exposure", exposure);
  ASSERT_TRUE(read_back) << read_back.error().message;
  const auto& poses = std::get<record::Exposure>(*read_back).poses;
  ASSERT_TRUE(poses && poses->tracker_from("femur"));
  EXPECT_EQ(poses->tracker_from("femur")->matrix(), pose(6).matrix());
  EXPECT_FALSE(poses->tracker_from("tibia"));

  const EndMiss miss{{0.3, 0.4}, Eigen::Matrix2d::Identity()};
  const auto outcome = read("outcome", content_of(record::Outcome{"femur", miss, miss}));
  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_FALSE(std::get<record::Outcome>(*outcome).depth);

  const Json lines = {{"tool_lines", {{{"name", "tool"}, {"tunnel", "tibia"}}}}};
  const auto begun = read("case", {{"folder", "case-2"}, {"case", lines}, {"files", Json::object()}});
  ASSERT_TRUE(begun) << begun.error().message;
  EXPECT_EQ(std::get<record::CaseBegun>(*begun).verifies, "tibia");
}

TEST(SessionRecords, TheSchemaHoldsEveryKind) {
  const Json kinds = session_schema()["properties"];
  EXPECT_EQ(kinds.size(), std::variant_size_v<Record>);
  EXPECT_TRUE(kinds["guided"]["properties"].contains("guidance"));
}

}  // namespace session_records_test
}  // namespace helicarm::operation
