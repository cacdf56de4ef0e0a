// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::operation {
namespace plan_test {

OperationPlan plan() {
  OperationPlan plan;
  plan.tracker.facets = {{"calibrator/1", {Eigen::Matrix3d::Identity(), {85, 0, 10}}}};
  plan.robot.tool = {{Eigen::Matrix3d::Identity(), {0, 0, 150}}, 1.2};
  plan.robot.approach.keep_outs = {{{0, 0, -200}, Eigen::Vector3d::UnitZ()}};
  plan.tunnels = {{"femur", "femur", "FS", "FE", TunnelEnd::end}};
  plan.max_error_mm = 2;
  return plan;
}

TEST(Plan, WrittenPlanReadsBackEqual) {
  const Json json = to_json(plan());
  const auto read = plan_from(json, "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_json(*read), json);
}

Json with_model() {
  Json json = to_json(plan());
  json["models"] = {
      {{"name", "femur"},
       {"volume", "ct.nrrd"},
       {"window_hu", {150, 3000}},
       {"start",
        {{"world_from_model", {{0.96, -0.28, 0, 1.5}, {0.28, 0.96, 0, -2}, {0, 0, 1, 0.1}, {0, 0, 0, 1}}}}},
       {"plan", "femur.mrk.json"}}};
  json["tunnels"] = {{{"name", "ACL"},
                      {"bone", "femur"},
                      {"model", "femur"},
                      {"line", "F"},
                      {"diameter_mm", 8},
                      {"bridge_mm", nullptr},
                      {"enter_at", "end"}}};
  return json;
}

TEST(Plan, ALineOfAModelsPlanIsATunnelOfItsBone) {
  const auto read = plan_from(with_model(), "/somewhere/plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->models.at(0).volume, "/somewhere/ct.nrrd");
  EXPECT_EQ(read->models[0].moves_with, "femur");
  const OperationTunnel& tunnel = read->tunnels.at(0);
  ASSERT_TRUE(tunnel.of_model);
  EXPECT_EQ(tunnel.of_model->diameter_mm, 8);
  EXPECT_EQ(tunnel.start, "F_start");
  EXPECT_EQ(tunnel.enter_at, TunnelEnd::end);
  const Json written = to_json(*read);
  EXPECT_EQ(to_json(*plan_from(written, "/elsewhere/plan.json")), written) << "also its pose, to the bit";
}

TEST(Plan, AModelThatMovesWithNoBoneGuidesNothing) {
  Json json = with_model();
  json["tunnels"][0].erase("bone");
  EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::bad_value);
  json["models"][0]["moves_with"] = "tibia";
  EXPECT_EQ(plan_from(json, "plan.json")->tunnels.at(0).bone, "tibia");
  json["tunnels"][0]["bone"] = "femur";
  EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::bad_value);
}

TEST(Plan, OptionsOfTheMeasurementsLeadThroughTheFile) {
  OperationPlan settings = plan();
  settings.measuring.run.method = rectification::Method::paper;
  settings.measuring.run.motion_sigma_mm = 0.4;
  settings.measuring.search = {40, 60};
  settings.measuring.run.history = calibration::CArmHistory{
      {{"digest", "AP", {1000, 1, -2}, Eigen::Vector3d(4, 5, 6).asDiagonal().toDenseMatrix()}}};
  const auto read = plan_from(to_json(settings), "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  const auto [options, search] = measuring_options(*read);
  EXPECT_EQ(options.method, rectification::Method::paper);
  EXPECT_EQ(options.max_error_mm, 2);
  EXPECT_EQ(options.motion_sigma_mm, 0.4);
  EXPECT_EQ(search, (case_registration::SearchRange{40, 60}));
  ASSERT_TRUE(options.history);
  EXPECT_EQ(options.history->entries.front().image, "digest");
}

TEST(Plan, OptionsOfEarlierPlansAreTheUsualOnes) {
  Json json = to_json(plan());
  for (const char* key : {"method", "motion_sigma_mm", "search_mm", "search_deg", "machine"}) json.erase(key);
  const auto read = plan_from(json, "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->measuring.run.method, rectification::Method::best);
  EXPECT_FALSE(read->measuring.run.history);
}

TEST(Plan, AMarkerIsOnOneBodyOnly) {
  const auto refused = [](const std::function<void(OperationPlan&)>& change) {
    OperationPlan contradictory = plan();
    contradictory.tracker.pointer = Pointer{"pointer", {0, 0, 100}};
    EXPECT_TRUE(plan_from(to_json(contradictory), "plan.json"));
    change(contradictory);
    const auto read = plan_from(to_json(contradictory), "plan.json");
    return read ? Reason::usage : read.error().reason;
  };
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.markers["tibia"] = "femur"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.tool = "tibia"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.facets[0].name = "femur"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.facets[0].name = "tool"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.pointer->name = "femur"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.pointer->name = "tool"; }), Reason::name_clash);
  EXPECT_EQ(refused([](OperationPlan& p) { p.tracker.pointer->name = "calibrator/1"; }), Reason::name_clash);
}

TEST(Plan, AMarkerOfAPlanOfVersion1IsOnOneBodyOnly) {
  Json json = to_json(plan());
  json["format"] = "helicarm-plan/1";
  json["tracker"].erase("markers");
  json["tracker"].update({{"femur", "F"}, {"tibia", "T"}, {"tool", "D"}});
  EXPECT_TRUE(plan_from(json, "plan.json"));
  json["tracker"]["tibia"] = "F";
  const auto refused = plan_from(json, "plan.json");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::name_clash);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("\"F\" is the marker of femur and of tibia"));
}

TEST(Plan, WhatTheRobotCannotCarryOutIsRefused) {
  OperationPlan approach = plan();
  approach.robot.approach.stand_off_mm = approach.robot.approach.gap_mm = 20;
  const auto refused = plan_from(to_json(approach), "plan.json");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_THAT(refused.error().message,
              testing::AllOf(testing::HasSubstr("stand_off_mm"), testing::HasSubstr("gap_mm")));
  OperationPlan heavy = plan();
  heavy.robot.tool.payload_kg = 5.1;
  EXPECT_EQ(plan_from(to_json(heavy), "plan.json").error().reason, Reason::bad_value);
}

TEST(Plan, HandHeldDrillTakesThePlaceOfTheRobot) {
  OperationPlan freehand = plan();
  freehand.drill = HandDrill{{1, -140, 3}, {2, -20, 5}, 0.15, 1.5, 3};
  Json json = to_json(freehand);
  EXPECT_FALSE(json.contains("robot"));
  const auto read = plan_from(json, "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_json(*read), json);
  json["robot"] = to_json(plan())["robot"];
  EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::bad_value);
}

TEST(Plan, DrillWhosePointsCoincideIsRefused) {
  OperationPlan freehand = plan();
  freehand.drill = HandDrill{{1, -140, 3}, {1, -135, 3}};
  EXPECT_EQ(plan_from(to_json(freehand), "plan.json").error().reason, Reason::bad_value);
}

TEST(Plan, RecordedPosesGuideNoRobot) {
  OperationPlan recorded = plan();
  recorded.tracker.address = "file:poses.mha";
  const auto refused = plan_from(to_json(recorded), "plan.json");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  recorded.drill = HandDrill{{1, -140, 3}, {2, -20, 5}};
  EXPECT_TRUE(plan_from(to_json(recorded), "plan.json"));
}

TEST(Plan, DefinitionsOfAnNdiTrackersToolsLieInThePlansFolder) {
  OperationPlan by_ndi = plan();
  by_ndi.tracker.address = "ndi:192.168.1.10";
  by_ndi.tracker.definitions = {{"femur", "tools/femur.rom"}};
  const OperationPlan read = plan_from(to_json(by_ndi), "/plans/plan.json").value();
  EXPECT_EQ(tracker_address(read).definitions.at("femur"), "/plans/tools/femur.rom");
  EXPECT_EQ(to_json(read)["tracker"]["definitions"]["femur"], "tools/femur.rom");  // as the record keeps it
}

TEST(Plan, DefinitionsWithoutAnNdiTrackerAreRefused) {
  OperationPlan other = plan();
  other.tracker.definitions = {{"femur", "femur.rom"}};
  const auto refused = plan_from(to_json(other), "plan.json");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
}

TEST(Plan, ErrorOfAMountIsAddedToThatOfTheReadings) {
  OperationPlan mounted = plan();
  mounted.tracker.sigma_mm = 0.12;
  mounted.tracker.facets[0].sigma_mm = 0.35;
  mounted.tracker.facets[0].sigma_deg = 0.2;
  const OperationPlan read = plan_from(to_json(mounted), "plan.json").value();
  EXPECT_NEAR(read.tracker.noise().sigma_mm, 0.37, 1e-12);
  EXPECT_NEAR(read.tracker.noise().sigma_deg, std::hypot(0.05, 0.2), 1e-12);
  EXPECT_EQ(plan().tracker.noise().sigma_mm, 0.12);
}

TEST(Plan, UnknownKeyIsRefused) {
  Json json = to_json(plan());
  json["robot"]["speed"] = 1;
  EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::unknown_key);
}

TEST(Plan, TunnelOrFacetGivenTwiceIsRefused) {
  for (const char* list : {"tunnels", "facets"}) {
    Json json = to_json(plan());
    Json& entries = std::string(list) == "tunnels" ? json["tunnels"] : json["tracker"]["facets"];
    entries.push_back(entries.front());
    EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::name_clash) << list;
  }
}

TEST(Plan, ViewNameThatIsAPathIsRefused) {
  Json json = to_json(plan());
  json["views"] = {"AP", "../LAT"};
  EXPECT_EQ(plan_from(json, "plan.json").error().reason, Reason::bad_value);
}

TEST(Plan, SpeedBeyondTheLimitIsRefusedWithItsKey) {
  Json json = to_json(plan());
  json["robot"]["approach"]["travel_mm_s"] = 5000;
  const auto read = plan_from(json, "plan.json");
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().message.find("travel_mm_s"), std::string::npos);
  EXPECT_NE(read.error().message.find("250"), std::string::npos);
}

TEST(Plan, LimitsOfAStalePlanMayBeLeftOutAndAreBounded) {
  for (const auto& [key, beyond] :
       {std::pair{"plan_stale_mm", 20.0}, {"plan_stale_deg", 0.1}, {"plan_stale_s", 0.5}}) {
    Json json = to_json(plan());
    json[key] = beyond;
    const auto read = plan_from(json, "plan.json");
    ASSERT_FALSE(read) << key;
    EXPECT_EQ(read.error().reason, Reason::bad_value);
    EXPECT_NE(read.error().message.find(key), std::string::npos);
    json.erase(key);
    const auto left_out = plan_from(json, "plan.json");
    ASSERT_TRUE(left_out) << left_out.error().message;
    EXPECT_EQ(to_json(*left_out), to_json(plan()));
  }
}

TEST(Plan, EarlierVersionNamesTheMarkersOfTheKnee) {
  Json json = to_json(plan());
  json["format"] = "helicarm-plan/1";
  json.erase("bones");
  json["tracker"].erase("markers");
  json["tracker"].update({{"femur", "F"}, {"tibia", "T"}, {"tool", "drill"}});
  const auto read = plan_from(json, "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->bones, guidance::knee_bones());
  EXPECT_EQ(read->tracker.marker_of("tibia"), "T");
  EXPECT_EQ(read->tracker.tool, "drill");
}

class PlanOfBones : public testing::Test {
 protected:
  PlanOfBones() {
    json_["bones"] = {"L4", "pelvis", "L5"};
    json_["tracker"]["markers"] = {{"L4", "a"}, {"pelvis", "b"}, {"L5", "c"}, {"tool", "d"}};
    json_["tunnels"][0]["bone"] = "L4";
    json_["check_points"] = Json::array();
  }
  std::string refusal() const { return plan_from(json_, "plan.json").error().message; }

  Json json_ = to_json(plan());
};

TEST_F(PlanOfBones, IsReadAndWrittenWithTheirNames) {
  const auto read = plan_from(json_, "plan.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->tracker.marker_of("L5"), "c");
  EXPECT_EQ(read->tunnels[0].bone, "L4");
  EXPECT_EQ(to_json(*plan_from(to_json(*read), "plan.json")), to_json(*read));
}

TEST_F(PlanOfBones, TunnelInABoneThatIsNotNamedIsRefused) {
  json_["tunnels"][0]["bone"] = "L3";
  EXPECT_THAT(refusal(), testing::HasSubstr("\"L3\" is not a bone; \"bones\" names L4, pelvis, L5"));
}

TEST_F(PlanOfBones, BoneWithoutAMarkerIsRefused) {
  json_["tracker"]["markers"].erase("L5");
  EXPECT_THAT(refusal(), testing::HasSubstr("\"L5\""));
}

TEST_F(PlanOfBones, OtherKeysOfTheTrackerAreNoMarkers) {
  json_["bones"] = {"address"};
  json_["tunnels"][0]["bone"] = "address";
  json_["tracker"].erase("markers");
  json_["tracker"]["tool"] = "d";
  EXPECT_THAT(refusal(), testing::HasSubstr("\"markers\""));
}

TEST_F(PlanOfBones, OneMarkerOfTwoBonesIsRefused) {
  json_["tracker"]["markers"]["L5"] = "a";
  EXPECT_THAT(refusal(), testing::HasSubstr("\"a\" is the marker of L4 and of L5"));
}

TEST(Plan, FacetThatIsNotARigidMotionIsRefused) {
  Json json = to_json(plan());
  json["tracker"]["facets"][0]["calibrator_from_facet"][0][0] = 2;
  EXPECT_FALSE(plan_from(json, "plan.json"));
}

}  // namespace plan_test
}  // namespace helicarm::operation
