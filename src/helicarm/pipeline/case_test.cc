// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"

namespace helicarm::pipeline {
namespace {

using testing::HasSubstr;

class CaseFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("helicarm_case_" + std::to_string(::getpid()) + "_" +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    json_ = *parse_json(R"({
      "format": "helicarm-case/1", "calibrator": "udcsc", "plate": "plate48",
      "views": [{"name": "AP", "image": "AP.dcm"}, {"name": "LAT", "image": "LAT.dcm", "frame": 2}],
      "picks": [{"name": "FS", "view": "AP", "uv": [500.5, 401], "snap": "ball", "moves_with": "femur"},
                {"name": "FS", "view": "LAT", "uv": [512, 400], "moves_with": "femur", "sigma_px": 0},
                {"name": "FE", "view": "AP", "uv": [300, 401]}],
      "tunnels": [{"name": "femur", "start": "FS", "end": "FE"}],
      "tool_lines": [{"name": "drill", "tunnel": "femur", "p1_in_calibrator": [0, 0, 0],
                      "p2_in_calibrator": [0, 0, 30]}]})",
                        "test");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Expected<Case> read() {
    EXPECT_TRUE(write_file(folder_ / "case.json", json_.dump()).has_value());
    return read_case(folder_);
  }

  Failure failure() {
    auto result = read();
    EXPECT_FALSE(result.has_value());
    return result ? Failure{Reason::usage, "was read"} : result.error();
  }

  std::filesystem::path folder_;
  Json json_;
};

TEST_F(CaseFile, PixelSizeAndSourceDistanceOfAViewAreRead) {
  json_["views"][1]["pixel_mm"] = 0.21;
  json_["views"][1]["source_detector_mm"] = 1000;
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  EXPECT_FALSE(read_back->views[0].pixel_mm || read_back->views[0].source_detector_mm);
  EXPECT_EQ(read_back->views[1].pixel_mm, 0.21);
  EXPECT_EQ(read_back->views[1].source_detector_mm, 1000);
  json_["views"][1]["pixel_mm"] = 0;
  EXPECT_EQ(failure().reason, Reason::bad_value);
  json_["views"][1]["pixel_mm"] = nullptr;
  json_["views"][1]["source_detector_mm"] = 20;
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PositionerAnglesOfAViewAreStatedTogether) {
  json_["views"][1].update({{"primary_deg", 90}, {"secondary_deg", 0}});
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  EXPECT_FALSE(read_back->views[0].primary_deg);
  EXPECT_EQ(read_back->views[1].primary_deg, 90);
  EXPECT_EQ(read_back->views[1].secondary_deg, 0);
  json_["views"][1].erase("secondary_deg");
  EXPECT_NE(failure().message.find("secondary_deg"), std::string::npos);
}

TEST_F(CaseFile, WrittenCaseReadsBackEqual) {
  json_["bones"] = {"L4", "pelvis"};
  for (Json& pick : json_["picks"]) pick.erase("moves_with");
  json_["picks"][2].update({{"moves_with", "L4"}, {"bone", {{"name", "vertebra"}, {"side", "left"}}}});
  json_["notes"] = "lumbar spine";
  const Json pose = Json::parse("[[0,-1,0,105.25],[1,0,0,6],[0,0,1,700],[0,0,0,1]]");
  json_["views"][0].update(
      {{"mirrored", true}, {"pixel_mm", 0.21}, {"source_detector_mm", 1000}, {"map", "m/AP.json"}});
  json_["views"][1].update(
      {{"plate_image", "grid/LAT.dcm"},
       {"poses", {{"tracker_from_calibrator", pose}, {"tracker_from_bone", {{"L4", pose}}}}}});
  json_["poses_now"] = {{"tracker_from_bone", {{"pelvis", pose}}}, {"tracker_from_tool", pose}};
  json_["tracker"] = {{"sigma_mm", 0.1}, {"sigma_deg", 0}, {"samples", "shared"}};
  const auto first = read();
  ASSERT_TRUE(first) << first.error().message;
  const Json written = to_json(*first);
  EXPECT_EQ(written["views"][1]["poses"]["tracker_from_bone"]["L4"], pose);
  EXPECT_EQ(written["views"][0]["map"], "m/AP.json");
  EXPECT_EQ(written["picks"][2]["bone"]["side"], "left");
  EXPECT_EQ(written["tracker"]["samples"], "shared");
  json_ = written;
  const auto second = read();
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_EQ(to_json(*second), written);
}

TEST_F(CaseFile, NotesAreIgnoredAndMirroredIsRead) {
  json_["notes"] = "left knee of the phantom";
  json_["views"][1]["mirrored"] = true;
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  EXPECT_FALSE(read_back->views[0].mirrored);
  EXPECT_EQ(read_back->views[1].mirrored, true);
  json_["views"][1]["mirrored"] = "yes";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

const char* const identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

TEST_F(CaseFile, PosesInMetresAreRefused) {
  for (const char* in_metres :
       {"[[0,-1,0,-0.08],[1,0,0,0.1],[0,0,1,0.75]]", "[[1,0,0,2.1],[0,1,0,0],[0,0,1,3]]"}) {
    json_["views"][0]["poses"]["tracker_from_calibrator"] = Json::parse(in_metres);
    EXPECT_EQ(failure().reason, Reason::bad_value);
    EXPECT_NE(failure().message.find("metres"), std::string::npos) << failure().message;
  }
  // The tracker's frame may be a marker's: zero translations, or one large one.
  json_["views"][0]["poses"]["tracker_from_calibrator"] = Json::parse(identity);
  EXPECT_TRUE(read().has_value());
  json_["views"][0]["poses"]["tracker_from_femur"] = Json::parse("[[1,0,0,80],[0,1,0,0],[0,0,1,0]]");
  EXPECT_TRUE(read().has_value());
}

TEST_F(CaseFile, SinglePoseInMetresIsRefusedByName) {
  json_["views"][0]["poses"]["tracker_from_femur"] = Json::parse("[[1,0,0,300],[0,1,0,200],[0,0,1,1500]]");
  json_["views"][0]["poses"]["tracker_from_calibrator"] =
      Json::parse("[[0,-1,0,0.3],[1,0,0,0.2],[0,0,1,1.5]]");
  EXPECT_EQ(failure().reason, Reason::bad_value);
  EXPECT_NE(failure().message.find("tracker_from_calibrator"), std::string::npos) << failure().message;
  // Small, but not turned: the tracker's frame follows this marker.
  json_["views"][0]["poses"]["tracker_from_calibrator"] =
      Json::parse("[[1,0,0,0.3],[0,1,0,0.2],[0,0,1,1.5]]");
  EXPECT_TRUE(read().has_value());
}

TEST_F(CaseFile, NullMeansNotStated) {
  json_["views"][1]["mirrored"] = nullptr;
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  EXPECT_FALSE(read_back->views[1].mirrored);
}

TEST_F(CaseFile, ReadsAllValues) {
  json_["views"][0]["poses"]["tracker_from_calibrator"] = Json::parse("[[0,-1,0,5],[1,0,0,6],[0,0,1,7]]");
  json_["tracker"] = Json::parse(R"({"sigma_mm": 0.12, "sigma_deg": 0.05, "samples": "shared"})");
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  EXPECT_EQ(read_back->calibrator.balls.size(), 12u);
  EXPECT_TRUE(read_back->plate);
  EXPECT_EQ(read_back->views[1].frame, 2);
  EXPECT_EQ(read_back->views[0].poses.tracker_from_calibrator->translation, Eigen::Vector3d(5, 6, 7));
  EXPECT_FALSE(read_back->views[1].poses.tracker_from_calibrator);
  EXPECT_EQ(read_back->picks[0].snap, Snap::ball);
  EXPECT_EQ(read_back->picks[0].moves_with, "femur");
  EXPECT_EQ(read_back->picks[1].sigma_px, 0.0);
  EXPECT_FALSE(read_back->picks[2].moves_with);
  EXPECT_EQ(read_back->tracker.samples, guidance::Samples::shared);
  EXPECT_EQ(read_back->tool_lines[0].tunnel, "femur");
}

TEST_F(CaseFile, MayBeGivenByItsFile) {
  ASSERT_TRUE(read());
  const auto by_file = read_case(folder_ / "case.json");
  ASSERT_TRUE(by_file) << by_file.error().message;
  EXPECT_TRUE(std::filesystem::equivalent(by_file->folder, folder_));
}

TEST_F(CaseFile, UnknownCalibratorNamesTheBuiltInOne) {
  json_["calibrator"] = "udcs";
  EXPECT_NE(read().error().message.find("udcsc"), std::string::npos);
  json_["calibrator"] = "udcsc";
  json_["plate"] = "plate84";
  EXPECT_NE(read().error().message.find("plate48"), std::string::npos);
}

TEST_F(CaseFile, NeedsOnlyFormatCalibratorAndViews) {
  for (const char* key : {"plate", "picks", "tunnels", "tool_lines"}) json_.erase(key);
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value());
  EXPECT_FALSE(read_back->plate);
}

TEST_F(CaseFile, MissingFolderIsMissingFile) {
  EXPECT_EQ(read_case(folder_ / "nowhere").error().reason, Reason::missing_file);
}

TEST_F(CaseFile, UnknownKeysAreRefusedAtEveryLevel) {
  const Json good = json_;
  const auto refused = [&] { return failure().reason == Reason::unknown_key; };
  json_["pick"] = 1;
  EXPECT_TRUE(refused());
  json_ = good;
  json_["views"][0]["pose"] = 1;
  EXPECT_TRUE(refused());
  json_ = good;
  json_["picks"][0]["colour"] = 1;
  EXPECT_TRUE(refused());
  json_ = good;
  json_["views"][0]["poses"] = Json::parse(R"({"tracker_from_tool": null})");
  EXPECT_TRUE(refused());
}

TEST_F(CaseFile, AnotherFormatIsRefused) {
  json_["format"] = "helicarm-case/3";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, OneViewIsEnough) {
  json_["views"].erase(1);
  json_["picks"].erase(1);
  EXPECT_TRUE(read());
}

TEST_F(CaseFile, NoViewIsTooFew) {
  json_["views"].clear();
  json_["picks"].clear();
  json_["tunnels"].clear();
  json_["tool_lines"].clear();
  EXPECT_THAT(failure().message, HasSubstr("at least one view"));
}

TEST_F(CaseFile, TwoViewsOfOneNameClash) {
  json_["views"][1]["name"] = "AP";
  EXPECT_EQ(failure().reason, Reason::name_clash);
}

TEST_F(CaseFile, PathsMayNotLeaveTheFolder) {
  for (const char* path : {"../AP.dcm", "/etc/passwd"}) {
    json_["views"][0]["image"] = path;
    EXPECT_EQ(failure().reason, Reason::path_outside);
  }
}

TEST_F(CaseFile, PlateImageAndMapExcludeEachOther) {
  json_["views"][0]["plate_image"] = "PLATE.dcm";
  json_["views"][0]["map"] = "map.json";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PlateImageNeedsAPlate) {
  json_["plate"] = nullptr;
  json_["views"][0]["plate_image"] = "PLATE.dcm";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PickGivenTwiceInOneViewClashes) {
  json_["picks"].push_back(json_["picks"][0]);
  EXPECT_EQ(failure().reason, Reason::name_clash);
}

TEST_F(CaseFile, PickInAnUnknownViewIsRefused) {
  json_["picks"][0]["view"] = "OBLIQUE";
  EXPECT_THAT(failure().message, HasSubstr("OBLIQUE"));
}

TEST_F(CaseFile, PickMovesWithOneBone) {
  json_["picks"][1]["moves_with"] = "tibia";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PickAndTargetMayNotShareAName) {
  Json calibrator = phantom::to_json(phantom::udcsc());
  calibrator["name"] = "own";
  calibrator["targets"] =
      Json::parse(R"([{"name": "FS", "xyz_mm": [0, 0, 30], "kind": "ball", "diameter_mm": 3}])");
  ASSERT_TRUE(write_file(folder_ / "calibrator.json", calibrator.dump()).has_value());
  json_["calibrator"] = "calibrator.json";
  EXPECT_EQ(failure().reason, Reason::name_clash);
}

TEST_F(CaseFile, BuiltInNameWithOtherPlacesIsAWarning) {
  Json calibrator = phantom::to_json(phantom::udcsc());
  calibrator["balls"][3]["xyz_mm"][2] = 20.0;
  ASSERT_TRUE(write_file(folder_ / "calibrator.json", calibrator.dump()).has_value());
  json_["calibrator"] = "calibrator.json";
  const auto read_back = read();
  ASSERT_TRUE(read_back.has_value()) << read_back.error().message;
  ASSERT_EQ(read_back->warnings.size(), 1u);
  EXPECT_EQ(read_back->warnings[0].reason, Reason::name_differs);
}

TEST_F(CaseFile, TunnelOfAnUnknownPickIsRefused) {
  json_["tunnels"][0]["end"] = "XX";
  EXPECT_THAT(failure().message, HasSubstr("XX"));
}

TEST_F(CaseFile, ToolLineOfAnUnknownTunnelIsRefused) {
  json_["tool_lines"][0]["tunnel"] = "XX";
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PhantomWithoutAFileNeedsItsDiameters) {
  json_["calibrator"] = nullptr;
  EXPECT_TRUE(write_file(folder_ / "case.json", json_.dump()).has_value());
  const auto refused = read_case(folder_, Purpose::phantom);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message,
            "case.json: \"diameters_mm\": is missing: required where \"calibrator\" is null");
  json_["diameters_mm"] = {4, 6};
  EXPECT_TRUE(write_file(folder_ / "case.json", json_.dump()).has_value());
  EXPECT_TRUE(read_case(folder_, Purpose::phantom));
}

TEST_F(CaseFile, ToolLineNeedsTwoPlaces) {
  json_["tool_lines"][0]["p2_in_calibrator"] = Json::array({0, 0, 0});
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST_F(CaseFile, PosesMustBeRigid) {
  const auto reason_of_pose = [&](const char* text) {
    json_["poses_now"]["tracker_from_tool"] = Json::parse(text);
    return failure().reason;
  };
  EXPECT_EQ(reason_of_pose("[[1.01,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), Reason::bad_value);
  EXPECT_EQ(reason_of_pose("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"), Reason::bad_value);
  EXPECT_EQ(reason_of_pose("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,0]]"), Reason::bad_value);
  EXPECT_EQ(reason_of_pose("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]"), Reason::bad_value);
  EXPECT_EQ(reason_of_pose("[[1,0],[0,1]]"), Reason::bad_value);
  json_["poses_now"]["tracker_from_tool"] = Json::parse(identity);
  EXPECT_TRUE(read().has_value());
}

TEST_F(CaseFile, NumbersMustBeFiniteAndInRange) {
  json_["tracker"] = Json::parse(R"({"sigma_mm": -0.1, "sigma_deg": 0})");
  EXPECT_EQ(failure().reason, Reason::bad_value);
  ASSERT_TRUE(write_file(folder_ / "case.json", R"({"format": "helicarm-case/1", "x": NaN})").has_value());
  EXPECT_EQ(read_case(folder_).error().reason, Reason::not_finite);
}

TEST_F(CaseFile, NegativeSigmaOfAPickIsRefused) {
  json_["picks"][0]["sigma_px"] = -1;
  EXPECT_EQ(failure().reason, Reason::bad_value);
}

TEST(Case, SchemaKnowsTheKeysOfEveryCommand) {
  const Json keys = case_schema()["properties"];
  for (const char* key : {"models", "markers", "bodies", "frame_rate_hz"})
    EXPECT_TRUE(keys.contains(key)) << key;
  for (const char* key : {"camera", "frames", "frame_offset"})
    EXPECT_TRUE(keys["views"]["items"]["properties"].contains(key)) << key;
  const Json& tunnel = keys["tunnels"]["items"];
  EXPECT_FALSE(tunnel.contains("required"));
  EXPECT_EQ(tunnel["anyOf"][1]["required"], Json::array({"name", "model"}));
}

TEST_F(CaseFile, KeysOfAnotherCommandNameIt) {
  json_["views"][0]["frame_offset"] = 3;
  EXPECT_EQ(failure().reason, Reason::bad_value);
  EXPECT_THAT(failure().message, HasSubstr("helicarm track"));
}

TEST(Case, RoundTripOfPicks) {
  std::vector<Pick> picks{{"FS", "AP", {512.25, 300.5}, Snap::ball, 3, {}, "femur"},
                          {"FS", "LAT", {401, 299}, Snap::none, 3, 0.5, "femur"}};
  picks[0].bone = {"condyle", Side::right};
  picks[1].bone = {"femur"};
  Json json = Json::array();
  for (const Pick& pick : picks) json.push_back(to_json(pick));
  std::vector<CaseView> views(2);
  views[0].name = "AP", views[1].name = "LAT";
  const auto again = picks_from(json, "plan", views, guidance::knee_bones()).value();
  ASSERT_EQ(again.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(to_json(again[i]), to_json(picks[i]));
    EXPECT_EQ(again[i].bone, picks[i].bone);
  }
  json[0]["bone"]["side"] = "medial";
  EXPECT_EQ(picks_from(json, "plan", views, guidance::knee_bones()).error().reason, Reason::bad_value);
  json[0]["bone"]["side"] = "left";
  views.pop_back();
  EXPECT_EQ(picks_from(json, "plan", views, guidance::knee_bones()).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::pipeline
