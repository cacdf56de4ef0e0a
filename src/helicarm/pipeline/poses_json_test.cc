// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/poses_json.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

const char* const shifted = "[[1,0,0,100],[0,1,0,0],[0,0,1,900],[0,0,0,1]]";

Expected<std::vector<guidance::Bone>> bones_of(const std::string& list) {
  const Json json = {{"bones", Json::parse(list)}};
  return guarded([&] {
    JsonReader reader(json, "case.json");
    return bones_from(reader);
  });
}

Expected<guidance::Poses> poses_of(const std::string& text, const std::vector<guidance::Bone>& bones) {
  const Json json = Json::parse(text);
  return guarded([&] { return poses_from(JsonReader(json, "case.json"), bones, OtherMarker::tool); });
}

TEST(Bones, AreTheKneesWhereNoneAreNamed) { EXPECT_EQ(bones_of("null"), guidance::knee_bones()); }

TEST(Bones, AreTheCasesOwnInItsOrder) {
  EXPECT_EQ(bones_of(R"(["pelvis", "L4"])"), (std::vector<guidance::Bone>{"pelvis", "L4"}));
  EXPECT_TRUE(bones_of("[]")->empty());
}

TEST(Bones, OneNameTwiceIsRefused) {
  EXPECT_EQ(bones_of(R"(["L4", "L4"])").error().reason, Reason::name_clash);
}

TEST(Bones, NameOfAnotherFrameIsRefused) {
  EXPECT_EQ(bones_of(R"(["tool"])").error().reason, Reason::name_clash);
}

TEST(Bones, NameThatIsNoTextIsRefused) {
  EXPECT_EQ(bones_of("[4]").error().reason, Reason::bad_value);
  EXPECT_EQ(bones_of(R"([""])").error().reason, Reason::bad_value);
}

TEST(PosesJson, AreReadByTheBonesNames) {
  const auto poses = poses_of(
      std::string(R"({"tracker_from_bone": {"L4": )") + shifted + R"(, "pelvis": null}})", {"L4", "pelvis"});
  ASSERT_TRUE(poses) << poses.error().message;
  EXPECT_EQ(poses->tracker_from("L4")->translation.z(), 900);
  EXPECT_FALSE(poses->tracker_from("pelvis"));
}

TEST(PosesJson, BoneMayBeNamedBone) {
  const auto poses = poses_of(std::string(R"({"tracker_from_bone": {"bone": )") + shifted + "}}", {"bone"});
  ASSERT_TRUE(poses) << poses.error().message;
  EXPECT_TRUE(poses->tracker_from("bone"));
}

TEST(PosesJson, OfTheKneeAreReadFromTheirOwnKeys) {
  const auto poses =
      poses_of(std::string(R"({"tracker_from_tibia": )") + shifted + "}", guidance::knee_bones());
  ASSERT_TRUE(poses) << poses.error().message;
  EXPECT_TRUE(poses->tracker_from("tibia"));
}

TEST(PosesJson, PoseGivenTwiceIsRefused) {
  const auto poses = poses_of(std::string(R"({"tracker_from_bone": {"femur": )") + shifted +
                                  R"(}, "tracker_from_femur": )" + shifted + "}",
                              guidance::knee_bones());
  EXPECT_EQ(poses.error().reason, Reason::name_clash);
}

TEST(PosesJson, PoseOfABoneThatIsNotNamedIsRefused) {
  EXPECT_EQ(poses_of(std::string(R"({"tracker_from_bone": {"L3": )") + shifted + "}}", {"L4"}).error().reason,
            Reason::unknown_key);
  EXPECT_EQ(poses_of(std::string(R"({"tracker_from_femur": )") + shifted + "}", {"L4"}).error().reason,
            Reason::unknown_key);
}

TEST(PosesJson, WrittenPosesAreReadAgain) {
  guidance::Poses poses;
  poses.tracker_from_tool = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {1, 2, 3}};
  poses.tracker_from_bone["L4"] = {Eigen::Matrix3d::Identity(), {4, 5, 600}};
  const Json written = to_json(poses, OtherMarker::tool);
  EXPECT_EQ(to_json(*poses_of(written.dump(), {"L4"}), OtherMarker::tool), written);
}

TEST(PosesJson, EarlierRecordsAreBroughtIntoThePresentForm) {
  guidance::Poses poses;
  poses.tracker_from_bone["femur"] = {Eigen::Matrix3d::Identity(), {4, 5, 600}};
  const Json present = to_json(poses);
  Json earlier = {{"tracker_from_calibrator", nullptr},
                  {"tracker_from_femur", present["tracker_from_bone"]["femur"]},
                  {"tracker_from_tibia", nullptr},
                  {"tracker_from_tool", nullptr}};
  EXPECT_EQ(in_present_form(earlier), present);
  EXPECT_EQ(in_present_form(present), present);
  EXPECT_TRUE(in_present_form(nullptr).is_null());
}

}  // namespace
}  // namespace helicarm::pipeline
