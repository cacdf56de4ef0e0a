// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_bundle.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::pipeline {
namespace {

/// A simulated case in which every text names the patient.
class BundleOfNamedCase : public testing::Test {
 protected:
  void SetUp() override {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.seed = 5;
    ASSERT_TRUE(simulation::write_case(folder_.path(), *simulation::simulate_case(options)));
    Json json = *read_json(folder_.path() / "case.json");
    json["notes"] = "knee of Jane Doe";
    for (Json& view : json["views"]) {
      const auto name = view["name"].get<std::string>();
      std::filesystem::rename(folder_.path() / (name + ".dcm"), folder_.path() / ("doe_" + name + ".dcm"));
      view["image"] = "doe_" + name + ".dcm";
      view["name"] = "doe_" + name;
    }
    const auto name = [](Json& entry, const char* key) {
      entry[key] = "doe_" + entry[key].get<std::string>();
    };
    for (Json& pick : json["picks"]) name(pick, "name"), name(pick, "view");
    for (Json& tunnel : json["tunnels"]) name(tunnel, "name"), name(tunnel, "start"), name(tunnel, "end");
    for (Json& line : json["tool_lines"]) name(line, "name"), name(line, "tunnel");
    ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
  }

  CaseBundle bundle(const BundleOptions& options = {}) {
    auto made = bundle_case(folder_.path(), options);
    EXPECT_TRUE(made) << made.error().message;
    return made ? *made : CaseBundle{};
  }

  static std::vector<std::string> names(const CaseBundle& bundle) {
    std::vector<std::string> all;
    for (const ArchivedFile& file : bundle.files) all.push_back(file.name);
    return all;
  }

  TemporaryFolder folder_;
};

TEST_F(BundleOfNamedCase, HoldsNoNameAndRuns) {
  const CaseBundle made = bundle();
  EXPECT_THAT(names(made), testing::ElementsAre("calibrator.json", "plate.json", "V1.dcm", "V2.dcm",
                                                "case.json", "result.json", "log.txt"));
  for (const ArchivedFile& file : made.files)
    for (const char* word : {"doe", "Doe", "Jane", "SIM5", "SIMULATED", "tmp"})
      EXPECT_EQ(file.bytes.find(word), std::string::npos) << file.name << ": " << word;
  const auto result = parse_json(made.files[5].bytes, "result.json");
  EXPECT_EQ((*result)["status"], "ok");
  EXPECT_EQ((*result)["tunnels"].size(), 2u);
  EXPECT_FALSE(result->contains("timing_ms"));
}

TEST_F(BundleOfNamedCase, HoldsNothingOfItsModels) {
  Json json = *read_json(folder_.path() / "case.json");
  json["models"] = {
      {{"name", "doe_femur"},
       {"volume", "doe_ct.nrrd"},
       {"mask", "doe_mask.nrrd"},
       {"start", {{"landmarks", "doe_points.csv"}}},
       {"plan", "doe_plan.mrk.json"}},
      {{"name", "doe_tibia"},
       {"surface", "doe_tibia.stl"},
       {"start", {{"world_from_model", {{1, 0, 0, 1234.5}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}}}}};
  json["picks"][0]["bone"] = {{"name", "doe_bone"}, {"side", "left"}};
  ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
  BundleOptions with_result;
  with_result.result = Json{{"models", {{{"name", "doe_femur"}, {"x", 1}}}}};
  const CaseBundle made = bundle(with_result);
  EXPECT_THAT(made.left_out,
              testing::ElementsAre("model1: models are not packed", "model2: models are not packed"));
  EXPECT_THAT(names(made), testing::Contains("result.json"));
  for (const ArchivedFile& file : made.files)
    for (const char* word : {"doe", "nrrd", "stl", "csv", "1234.5", "mrk"})
      if (!file.name.ends_with(".dcm")) {
        EXPECT_EQ(file.bytes.find(word), std::string::npos) << file.name << ": " << word;
      }
  const auto packed = std::ranges::find(made.files, "case.json", &ArchivedFile::name);
  EXPECT_EQ(parse_json(packed->bytes, "case.json")->at("picks")[0]["bone"]["name"], "bone1");
}

TEST_F(BundleOfNamedCase, LeavesOutTunnelsOfModels) {
  Json json = *read_json(folder_.path() / "case.json");
  json["models"] = {{{"name", "doe_femur"},
                     {"surface", "doe_femur.stl"},
                     {"start", {{"landmarks", "doe_points.csv"}}},
                     {"plan", "doe_plan.mrk.json"}}};
  json["tunnels"].push_back({{"name", "doe_planned"}, {"model", "doe_femur"}, {"line", "doe_line"}});
  const std::size_t tunnels = json["tunnels"].size();
  ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
  BundleOptions with_result;
  with_result.result = Json{{"tunnels", {{{"name", "doe_planned"}}}}};
  const CaseBundle made = bundle(with_result);
  EXPECT_THAT(
      made.left_out,
      testing::ElementsAre("model1: models are not packed",
                           fmt::format("tunnel{}: is a line of a model, which is not packed", tunnels)));
  EXPECT_THAT(names(made), testing::Contains("result.json"));
  const auto given = std::ranges::find(made.files, "given_result.json", &ArchivedFile::name);
  ASSERT_NE(given, made.files.end());
  EXPECT_THAT(given->bytes, testing::HasSubstr(fmt::format("tunnel{}", tunnels)));
  for (const ArchivedFile& file : made.files)
    EXPECT_EQ(file.bytes.find("doe"), std::string::npos) << file.name;
}

TEST_F(BundleOfNamedCase, IsNotWrittenOverItsOwnSources) {
  const auto reason = [&](const std::filesystem::path& out) {
    const auto checked = check_bundle_file(out, folder_.path(), folder_.path() / "result");
    return checked ? std::optional<Reason>() : checked.error().reason;
  };
  ASSERT_TRUE(write_file(folder_.path() / "result" / "result.json", "{}"));
  ASSERT_TRUE(write_file(folder_.path() / "earlier.tar.gz", "x"));
  for (const char* source :
       {"case.json", "doe_AP.dcm", "calibrator.json", "plate.json", "result/result.json"})
    EXPECT_EQ(reason(folder_.path() / source), Reason::name_clash) << source;
  EXPECT_EQ(reason(folder_.path() / "earlier.tar.gz"), std::nullopt);
  EXPECT_EQ(reason(folder_.path() / "new.tar.gz"), std::nullopt);
}

TEST_F(BundleOfNamedCase, NumbersTheBonesThatTheCaseNames) {
  Json json = *read_json(folder_.path() / "case.json");
  json["bones"] = {"doe_bone", "tibia"};
  const auto rename = [](Json& poses) {
    Json& bones = poses["tracker_from_bone"];
    bones["doe_bone"] = bones["femur"];
    bones.erase("femur");
  };
  rename(json["poses_now"]);
  for (Json& view : json["views"]) rename(view["poses"]);
  for (Json& pick : json["picks"])
    if (pick["moves_with"] == "femur") pick["moves_with"] = "doe_bone";
  ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
  const CaseBundle made = bundle({});
  for (const ArchivedFile& file : made.files)
    EXPECT_EQ(file.bytes.find("doe"), std::string::npos) << file.name;
  const auto result =
      parse_json(std::ranges::find(made.files, "result.json", &ArchivedFile::name)->bytes, "result.json");
  EXPECT_TRUE(result->at("points")[0]["in_bones"].contains("tracked_bone1"));
  EXPECT_FALSE(result->at("points")[0]["in_tool"].is_null());
}

TEST_F(BundleOfNamedCase, KeepsWhatAViewStatesOfItsImage) {
  Json json = *read_json(folder_.path() / "case.json");
  const auto image = xray::read_xray_image(folder_.path() / "doe_AP.dcm", "AP", {});
  json["views"][0]["pixel_mm"] = image->acquisition.pixel_mm->x();
  ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
  const CaseBundle made = bundle({.measure = false});
  const auto file = std::ranges::find(made.files, "case.json", &ArchivedFile::name);
  EXPECT_EQ((*parse_json(file->bytes, "case.json"))["views"][0]["pixel_mm"], json["views"][0]["pixel_mm"]);
}

/// Names of an object's keys in its schema.
std::set<std::string> keys_of(const Json& schema) {
  std::set<std::string> keys;
  for (const auto& [key, description] : schema.at("properties").items()) keys.insert(key);
  return keys;
}

TEST(BundledKeys, AreAllOfACaseOrLeftOutByName) {
  const auto both = [](const auto& packed, const auto& left_out) {
    std::set<std::string> all(packed.begin(), packed.end());
    all.insert(left_out.begin(), left_out.end());
    return all;
  };
  const Json schema = case_schema();
  EXPECT_EQ(both(packed_keys, unpacked_keys), keys_of(schema));
  EXPECT_EQ(both(packed_view_keys, unpacked_view_keys),
            keys_of(schema.at("properties").at("views").at("items")));
}

TEST_F(BundleOfNamedCase, IsTheSameEachTime) {
  const BundleOptions only_files{.measure = false};
  EXPECT_EQ(tar_gz(bundle(only_files).files), tar_gz(bundle(only_files).files));
}

TEST_F(BundleOfNamedCase, LeavesOutAnImageThatCannotBeRead) {
  ASSERT_TRUE(write_file(folder_.path() / "doe_AP.dcm", "Jane Doe"));
  const CaseBundle made = bundle();
  EXPECT_THAT(made.left_out, testing::ElementsAre("V1.dcm: not_an_image"));
  EXPECT_THAT(names(made), testing::Not(testing::Contains("result.json")));
  EXPECT_THAT(made.files.back().bytes, testing::HasSubstr("not packed: V1.dcm"));
}

TEST_F(BundleOfNamedCase, TakesFiguresAndNotTextsFromAGivenResult) {
  const Json given = {
      {"status", "refused"},
      {"failure", {{"code", "ambiguous_labels"}, {"message", "Jane Doe"}, {"view", "doe_LAT"}}},
      {"doe_AP", 17}};
  BundleOptions with_result;
  with_result.measure = false;
  with_result.result = given;
  const CaseBundle made = bundle(with_result);
  const auto file = std::ranges::find(made.files, "given_result.json", &ArchivedFile::name);
  ASSERT_NE(file, made.files.end());
  const Json written = *parse_json(file->bytes, "given_result.json");
  EXPECT_EQ(written["V1"], 17);
  EXPECT_EQ(file->bytes.find("oe"), std::string::npos) << file->bytes;
  EXPECT_NE(file->bytes.find("ambiguous_labels"), std::string::npos);
  EXPECT_NE(file->bytes.find("V2"), std::string::npos);
}

TEST(WithoutTexts, KeepsNumbersAndKnownTexts) {
  const Json given = {{"a", {1.5, "known", "Doe"}}, {"Doe", nullptr}};
  EXPECT_EQ(without_texts(given, {{"a", "a"}, {"known", "new"}}),
            (Json{{"a", {1.5, "new", "(removed)"}}, {"(removed)", nullptr}}));
}

}  // namespace
}  // namespace helicarm::pipeline
