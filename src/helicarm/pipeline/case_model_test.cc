// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/pipeline/case_description.h"

namespace helicarm::pipeline {
namespace {

/// A registration's case with these keys beside two cameras.
Expected<Case> registration_case(const std::string& keys, Purpose purpose = Purpose::registration) {
  const Json json = Json::parse(R"({"format": "helicarm-case/2", "views": [
      {"name": "A", "image": "a.png", "camera": "a.json"}, {"name": "B", "image": "b.png", "camera": "b.json"}])" +
                                keys + "}");
  return case_from_json(json, "case.json", "/case", purpose);
}

TEST(CaseModel, ARegistrationNeedsOne) {
  EXPECT_TRUE(registration_case(R"(, "models": [{"name": "femur", "surface": "f.stl"}])"));
  for (const char* none : {R"(, "models": [])", R"(, "models": null)", ""})
    EXPECT_EQ(registration_case(none).error().reason, Reason::bad_value) << none;
}

TEST(CaseModel, WrongOnesAreRefusedByEveryCommand) {
  for (const char* wrong :
       {R"(, "models": "femur")", R"(, "models": {"name": "femur"})", R"(, "models": [{"name": "femur"}])"}) {
    EXPECT_FALSE(registration_case(wrong)) << wrong;
    const Json json = Json::parse(
        R"({"format": "helicarm-case/2", "calibrator": "udcsc", "views": [{"name": "A", "image": "a.png"}])" +
        std::string(wrong) + "}");
    EXPECT_FALSE(case_from_json(json, "case.json", "/case")) << wrong;
  }
}

TEST(CaseModel, CamerasOfOtherProgramsAreForARegistrationAndForAllViews) {
  const char* models = R"(, "models": [{"name": "femur", "surface": "f.stl"}])";
  const auto read = registration_case(models);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(brings_cameras(*read));
  const auto measured = registration_case(models, Purpose::run);
  ASSERT_FALSE(measured);
  EXPECT_NE(measured.error().message.find("helicarm register"), std::string::npos);
  const Json one = Json::parse(R"({"format": "helicarm-case/2", "calibrator": "udcsc", "views": [
      {"name": "A", "image": "a.png", "camera": "a.json"}, {"name": "B", "image": "b.png"}],
      "models": [{"name": "femur", "surface": "f.stl"}]})");
  EXPECT_EQ(case_from_json(one, "case.json", "/case", Purpose::registration).error().reason,
            Reason::bad_value);
}

TEST(CaseModel, ACaseWithModelsAndLinesIsWrittenAsItIsRead) {
  const auto read =
      registration_case(R"(, "models": [{"name": "femur", "volume": "ct.nrrd", "window_hu": [150, 3000],
      "moves_with": "femur", "plan": "plan.mrk.json", "start": {"landmarks": "points.csv"}}],
      "tunnels": [{"name": "ACL", "model": "femur", "diameter_mm": 8, "bone": "femur"}])");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->model_tunnels.size(), 1u);
  EXPECT_TRUE(read->tunnels.empty());
  const Json written = to_json(*read);
  const auto again = case_from_json(written, "case.json", "/case", Purpose::registration);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(to_json(*again), written);
  EXPECT_EQ(again->models[0].landmarks, "/case/points.csv");
  EXPECT_EQ(again->model_tunnels[0].line, "ACL");
}

TEST(CaseModel, TheVoxelsOfATiffStackAreNoneOfASurface) {
  for (const char* key : {R"("voxel_mm": [1, 1, 1])", R"("tiff_offset_hu": -1024)"}) {
    const auto read =
        registration_case(fmt::format(R"(, "models": [{{"name": "femur", "surface": "f.stl", {}}}])", key));
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().message.find("needs a \"volume\""), std::string::npos) << read.error().message;
  }
}

TEST(CaseModel, TheLabelOfAMaskIsReadAndWritten) {
  const auto with = [&](const std::string& keys) {
    return registration_case(R"(, "models": [{"name": "femur", "volume": "ct.nrrd", )" + keys + "}]");
  };
  const auto read = with(R"("mask": "map.nrrd", "mask_label": 75)");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->models[0].mask.label, 75);
  EXPECT_EQ(to_json(read->models[0], "/case")["mask_label"], 75);
  for (const char* wrong : {R"("mask_label": 75)", R"("mask": "map.nrrd", "mask_label": 0)",
                            R"("mask": "map.nrrd", "mask_label": 1.5)"})
    EXPECT_EQ(with(wrong).error().reason, Reason::bad_value) << wrong;
}

TEST(CaseModel, TheBoneOfItsTunnelsIsReadAndWritten) {
  const auto with = [&](const std::string& keys) {
    return registration_case(R"(, "models": [{"name": "wrist", )" + keys + "}]");
  };
  const auto read = with(
      R"("volume": "ct.nrrd", "window_hu": [200, 3000], "tunnel_mask": "map.nrrd", "tunnel_mask_label": 4)");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->models[0].tunnel_mask.file, "/case/map.nrrd");
  const Json written = to_json(read->models[0], "/case");
  EXPECT_EQ(written["tunnel_mask"], "map.nrrd");
  EXPECT_EQ(written["tunnel_mask_label"], 4);
  for (const char* wrong : {R"("surface": "bones.stl", "tunnel_mask": "map.nrrd")",
                            R"("volume": "ct.nrrd", "tunnel_mask_label": 4)",
                            R"("volume": "ct.nrrd", "tunnel_mask": "map.nrrd", "tunnel_mask_label": 4,
                               "tunnel_mask_segment": "Scaphoid")"})
    EXPECT_EQ(with(wrong).error().reason, Reason::bad_value) << wrong;
}

/// The tunnel of a case with a model, or why it is refused.
Expected<ModelLine> tunnel_from(const char* tunnel, bool outlined = true) {
  const Json json = Json::parse(tunnel);
  CaseModel model;
  model.name = "femur", model.volume = "ct.nrrd", model.plan = "plan.mrk.json", model.moves_with = "femur";
  if (outlined) model.window_hu = Eigen::Vector2d(150, 3000);
  return guarded([&] {
    JsonReader reader(json, "tunnels[0]");
    std::vector<CaseModel> models{model};
    ModelLine read;
    read.name = reader.text("name");
    FromJson codec(reader);
    description::describe_model_line(codec, read, models, guidance::knee_bones());
    reader.finish();
    return read;
  });
}

TEST(ModelTunnel, ALineOfAPlanBecomesATunnelWithADiameter) {
  const auto tunnel = tunnel_from(
      R"({"name": "ACL", "bone": "femur", "model": "femur", "line": "F", "diameter_mm": 8, "bridge_mm": 3,
          "enter_at": "end"})");
  ASSERT_TRUE(tunnel) << tunnel.error().message;
  EXPECT_EQ(tunnel->line, "F");
  EXPECT_EQ(tunnel->diameter_mm, 8);
  EXPECT_EQ(tunnel->bridge_mm, 3);
  EXPECT_EQ(tunnel->enter_at, TunnelEnd::end);
}

TEST(ModelTunnel, TheUsualBridgeIsAskedForAndNoDiameterIsAssumed) {
  const auto tunnel = tunnel_from(R"({"name": "F", "model": "femur", "bridge_mm": null})");
  ASSERT_TRUE(tunnel) << tunnel.error().message;
  EXPECT_EQ(tunnel->line, "F");
  EXPECT_FALSE(tunnel->diameter_mm);
  EXPECT_EQ(tunnel->bridge_mm, 2);
}

TEST(ModelTunnel, AnotherModelAnotherBoneAndABodyWithoutAnOutlineAreRefused) {
  EXPECT_EQ(tunnel_from(R"({"name": "F", "model": "tibia"})").error().reason, Reason::bad_value);
  EXPECT_EQ(tunnel_from(R"({"name": "F", "model": "femur", "bone": "tibia"})").error().reason,
            Reason::bad_value);
  EXPECT_EQ(tunnel_from(R"({"name": "F", "model": "femur", "diameter_mm": 8})", false).error().reason,
            Reason::bad_value);
  EXPECT_EQ(tunnel_from(R"({"name": "F", "model": "femur", "diameter": 8})").error().reason,
            Reason::unknown_key);
}

}  // namespace
}  // namespace helicarm::pipeline
