// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/case_plans.h"

#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::case_registration {
namespace {

using testing::HasSubstr;

class CasePlans : public testing::Test {
 protected:
  /// A model whose plan has one line and one point.
  void add_model(const char* name, const char* line, const char* point, double length_mm = 30) {
    const auto at = [](const char* label, double z) {
      return Json{{"label", label}, {"position", {1, 2, z}}};
    };
    const Json ends = Json::array({at("1", 0), at("2", length_mm)}), points = Json::array({at(point, 5)});
    const Json tunnel = {{"type", "Line"}, {"name", line}, {"controlPoints", ends}};
    const Json list = {{"type", "Fiducial"}, {"controlPoints", points}};
    const Json plan = {{"markups", Json::array({tunnel, list})}};
    pipeline::CaseModel model;
    model.name = name;
    model.plan = folder_.path() / (std::string(name) + ".mrk.json");
    EXPECT_TRUE(write_file(*model.plan, to_text(plan)));
    given_.models.push_back(model);
  }
  void add_pick(const char* name) {
    pipeline::Pick pick;
    pick.name = name;
    given_.picks.push_back(pick);
  }
  Expected<std::vector<std::optional<MarkupPlan>>> plans() {
    return guarded([&] { return read_plans(given_); });
  }

  const TemporaryFolder folder_;
  pipeline::Case given_;
};

TEST_F(CasePlans, PointsOfTwoPlansMayShareANameTunnelsMayNot) {
  add_model("femur", "one", "F-1");
  add_model("tibia", "two", "F-1");
  ASSERT_TRUE(plans()) << plans().error().message;
  add_model("patella", "one", "F-2");
  ASSERT_FALSE(plans());
  EXPECT_EQ(plans().error().reason, Reason::name_clash);
  EXPECT_THAT(plans().error().message,
              HasSubstr("\"one\" is a tunnel of \"femur\"'s plan femur.mrk.json and"));
}

TEST_F(CasePlans, ATunnelOfThePicksIsAnother) {
  add_model("femur", "one", "F-1");
  pipeline::CaseTunnel tunnel;
  tunnel.name = "one";
  given_.tunnels.push_back(tunnel);
  EXPECT_EQ(plans().error().reason, Reason::name_clash);
}

TEST_F(CasePlans, APickIsAnotherPoint) {
  add_model("femur", "one", "entry");
  add_pick("elsewhere");
  EXPECT_TRUE(plans());
  add_pick("entry");
  EXPECT_EQ(plans().error().reason, Reason::name_clash);
}

TEST_F(CasePlans, AnEndOfATunnelIsAPointToo) {
  add_model("femur", "one", "entry");
  add_pick("one_start");
  EXPECT_EQ(plans().error().reason, Reason::name_clash);
}

TEST_F(CasePlans, APickedLandmarkMayBePlanned) {
  add_model("femur", "one", "entry");
  add_pick("entry");
  given_.models[0].landmarks = folder_.path() / "points.csv";
  EXPECT_TRUE(write_file(*given_.models[0].landmarks, "name,x_mm,y_mm,z_mm\nentry,1,2,5\n"));
  EXPECT_TRUE(plans()) << plans().error().message;
  EXPECT_TRUE(write_file(*given_.models[0].landmarks, "name,x_mm,y_mm,z_mm\nentry,1,2,9\n"));
  EXPECT_EQ(plans().error().reason, Reason::name_clash);
}

TEST_F(CasePlans, ATunnelOfTheCaseNamesALineAndGivesItsDiameter) {
  add_model("femur", "one", "F-1");
  given_.model_tunnels.push_back({"ACL", "femur", "one", 8.0, 3});
  const auto read = plans();
  ASSERT_TRUE(read) << read.error().message;
  const MarkupLine& tunnel = (*read)[0]->tunnels.at(0);
  EXPECT_EQ(tunnel.name, "ACL");
  EXPECT_EQ(tunnel.diameter_mm, 8);
  EXPECT_EQ(tunnel.bridge_mm, 3);
}

TEST_F(CasePlans, ALineInMetresIsRefusedAndItsUnitAskedFor) {
  add_model("femur", "one", "F-1", 0.03);
  EXPECT_EQ(plans().error().reason, Reason::bad_tunnel);
  EXPECT_THAT(
      plans().error().message,
      HasSubstr("femur: femur.mrk.json: \"one\" is 0.03 mm long, must be at least 1 mm: is the plan in m?"));
  given_.models.clear();
  add_model("femur", "one", "F-1", 300);
  EXPECT_TRUE(plans());
}

TEST_F(CasePlans, ATunnelOfNoLineOrOfALineOfAnotherIsRefused) {
  add_model("femur", "one", "F-1");
  given_.model_tunnels.push_back({"ACL", "femur", "two", 8.0});
  EXPECT_EQ(plans().error().reason, Reason::bad_value);
  EXPECT_THAT(plans().error().message, HasSubstr("is not a line of femur.mrk.json, which has: one"));
  given_.model_tunnels = {{"ACL", "femur", "one", 8.0}, {"PCL", "femur", "one", 7.0}};
  EXPECT_THAT(plans().error().message, HasSubstr("is a line of two tunnels"));
}

}  // namespace
}  // namespace helicarm::case_registration
