// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_picks.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::pipeline {
namespace {

Pick pick_at(const std::string& name, const std::string& view, const Eigen::Vector2d& uv_raw) {
  Pick pick;
  pick.name = name;
  pick.view = view;
  pick.uv_raw = uv_raw;
  return pick;
}

class CasePicks : public testing::Test {
 protected:
  Expected<PickedCase> picked(const std::string& rows) {
    const auto path = folder_.path() / "picks.csv";
    EXPECT_TRUE(write_file(path, "name,view,u_px,v_px,sigma_px\n" + rows));
    return with_picks(json_, *read_csv(path, {"name", "view", "u_px", "v_px"}, {"sigma_px"}), "picks.csv",
                      folder_.path());
  }

  TemporaryFolder folder_;
  Json json_ = *parse_json(R"({"format": "helicarm-case/1", "notes": "left", "calibrator": "udcsc",
    "views": [{"name": "AP", "image": "AP.dcm"}, {"name": "LAT", "image": "LAT.dcm"}],
    "picks": [{"name": "entry", "view": "AP", "uv": [1, 2], "snap": "ball", "moves_with": "femur"}]})",
                           "test");
};

TEST_F(CasePicks, AreAddedAndReplaced) {
  const auto made = picked("entry,AP,300.5,40,0.2\nentry,LAT,512,7,\n");
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->added, 1u);
  EXPECT_EQ(made->replaced, 1u);
  EXPECT_EQ(made->json["notes"], "left");
  EXPECT_EQ(made->json["picks"],
            *parse_json(R"([{"name": "entry", "view": "AP", "uv": [300.5, 40.0], "snap": "ball",
                             "moves_with": "femur", "sigma_px": 0.2},
                            {"name": "entry", "view": "LAT", "uv": [512.0, 7.0], "moves_with": "femur"}])",
                        "test"));
}

TEST_F(CasePicks, AllAreReplacedAndPickedTunnelsAdded) {
  const Pick start = pick_at("in", "AP", {3, 4}), end = pick_at("out", "LAT", {5, 6});
  const auto made =
      with_all_picks(json_, {start, end}, {{"femur", "in", "out"}, {"tibia", "TS", "TE"}}, folder_.path());
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ((*made)["picks"].size(), 2u);
  EXPECT_EQ((*made)["picks"][0]["name"], "in");
  EXPECT_EQ((*made)["tunnels"], *parse_json(R"([{"name": "femur", "start": "in", "end": "out"}])", "test"));
  EXPECT_EQ((*made)["notes"], "left");
}

TEST_F(CasePicks, WithoutAnEndOfTheCasesTunnelAreRefused) {
  json_["tunnels"] = *parse_json(R"([{"name": "femur", "start": "entry", "end": "exit"}])", "test");
  json_["picks"].push_back(*parse_json(R"({"name": "exit", "view": "LAT", "uv": [1, 2]})", "test"));
  const auto made = with_all_picks(json_, {pick_at("entry", "AP", {3, 4})}, {}, folder_.path());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().reason, Reason::bad_value);
}

TEST_F(CasePicks, OfAnUnknownViewAreRefused) {
  const Failure refusal = picked("entry,AP,1,2,\nentry,OBL,1,2,\n").error();
  EXPECT_EQ(refusal.reason, Reason::bad_value);
  EXPECT_EQ(refusal.message, "picks.csv: row 2: view: \"OBL\" is not a view of the case (views: AP, LAT)");
}

TEST_F(CasePicks, GivenTwiceAreRefused) {
  EXPECT_EQ(picked("exit,AP,1,2,\nexit,AP,3,4,\n").error().reason, Reason::name_clash);
}

TEST_F(CasePicks, AreNotTakenFromAnEmptyTable) { EXPECT_EQ(picked("").error().reason, Reason::bad_value); }

}  // namespace
}  // namespace helicarm::pipeline
