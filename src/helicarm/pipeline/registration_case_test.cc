// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/model_description.h"

namespace helicarm::pipeline {
namespace {

TEST(RegistrationCase, HasModelsIfItNamesAny) {
  const TemporaryFolder folder;
  const auto with = [&](const char* json) {
    EXPECT_TRUE(write_file(folder.path() / "case.json", json));
    return has_models(folder.path());
  };
  EXPECT_FALSE(has_models(folder.path()));
  EXPECT_TRUE(with(R"({"models": [{"name": "femur", "volume": "ct.nrrd"}]})"));
  EXPECT_TRUE(has_models(folder.path() / "case.json"));
  for (const char* none : {R"({"models": []})", R"({"models": null})", R"({})", R"([])", R"("models")", "{"})
    EXPECT_FALSE(with(none)) << none;
}

TEST(RegistrationCase, WrongModelsAreRefusedWhereTheyAreRead) {
  const TemporaryFolder folder;
  for (const char* wrong : {R"({"models": "femur"})", R"({"models": {"name": "femur"}})"}) {
    EXPECT_TRUE(write_file(folder.path() / "case.json", wrong));
    EXPECT_TRUE(has_models(folder.path())) << wrong;
    EXPECT_FALSE(read_registration_case(folder.path())) << wrong;
  }
}

TEST(RegistrationCase, AViewsImagesMayStartAtAnotherNumber) {
  const TemporaryFolder folder;
  const auto with = [&](const char* offset) {
    EXPECT_TRUE(
        write_file(folder.path() / "case.json", fmt::format(R"({{"format": "helicarm-case/1", "views": [
                             {{"name": "A", "image": "a{{frame:03d}}.png", "camera": "a.json"}},
                             {{"name": "B", "image": "b{{frame}}.png", "camera": "b.json", "frame_offset": {}}}],
                             "models": [{{"name": "femur", "surface": "f.stl"}}]}})",
                                                            offset)));
    return read_registration_case(folder.path());
  };
  const auto read = with("-3");
  ASSERT_TRUE(read) << read.error().message;
  const auto frame = at_frame(*read, 10);
  EXPECT_EQ(frame->base.views[0].image.filename(), "a010.png");
  EXPECT_EQ(frame->base.views[1].image.filename(), "b7.png");
  EXPECT_EQ(with("1.5").error().reason, Reason::bad_value);
}

/// The tunnel of a case with a model, or why it is refused.
Expected<ModelTunnelPlan> tunnel_from(const char* tunnel, bool outlined = true) {
  const Json json = Json::parse(tunnel);
  CaseModel model;
  model.name = "femur", model.volume = "ct.nrrd", model.plan = "plan.mrk.json", model.moves_with = "femur";
  if (outlined) model.window_hu = Eigen::Vector2d(150, 3000);
  return guarded([&] {
    JsonReader reader(json, "tunnels[0]");
    std::vector<CaseModel> models{model};
    ModelTunnelPlan read;
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
