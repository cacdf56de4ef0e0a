// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/bone_measures.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/case_registration/registration_tables.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/measures/measure_json.h"

namespace helicarm::case_registration {
namespace bone_measures_test {

using testing::HasSubstr;

const std::string head = "measure,kind,model,name,x_mm,y_mm,z_mm\n";
const std::string plateau =
    "t,tibia_ap,tibia,axis_medial,-35,0,0\nt,tibia_ap,tibia,axis_lateral,35,0,0\n"
    "t,tibia_ap,tibia,anterior,0,20,0\nt,tibia_ap,tibia,posterior,0,-25,0\n";

/// A view along the tibia's axis from 900 mm.
geometry::View lateral_view() {
  geometry::View view;
  view.intrinsics = {4000, 4000, 512, 512};
  view.camera_from_world.rotation << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  view.camera_from_world.translation = {0, 0, 900};
  return view;
}

/// A case with a tibia that was registered where its own frame is.
struct Tibia {
  TemporaryFolder folder;
  pipeline::Case the_case;
  LoadedViews loaded;
  RegisteredModel model;
  std::vector<std::optional<MarkupPlan>> plans{MarkupPlan{{{"FS", {0, 2, 0}}}, {}}};

  explicit Tibia(const std::string& rows) {
    auto& given = the_case.models.emplace_back();
    given.name = "tibia";
    given.measures = folder.path() / "t.csv";
    EXPECT_TRUE(write_file(*the_case.models[0].measures, head + rows));
    loaded.views.emplace_back().name = "LAT";
    loaded.maps.emplace_back();
    model.registration.name = "tibia";
    model.registration.decision = registration::Decision::accept;
    model.registration.covariance = 1e-6 * registration::RigidCovariance::Identity();
    model.registration.covariance.diagonal().tail<3>().setConstant(0.04);
    model.views = {lateral_view()};
    RegisteredPoint planned{"FS", {}};
    planned.place.in_calibrator = {0, 2, 0};
    model.points = {planned};
  }
  void pick(const std::string& name, const Eigen::Vector2d& uv) {
    auto& picked = the_case.picks.emplace_back();
    picked.name = name;
    picked.view = "LAT";
    picked.uv_raw = uv;
  }
  std::vector<measures::InBone> measured(const WorldPoints& located = {}) {
    return measures_of(read_measures(the_case, plans).at(0), located, the_case, loaded, model);
  }
};

TEST(BoneMeasures, APlannedPointIsExactAndALocatedOneHasBothErrors) {
  Tibia tibia(plateau + "t,tibia_ap,tibia,FS,,,\nt,tibia_ap,tibia,L,,,\nother,tibia_ap,femur,FS,1,2,3\n");
  tibia.pick("L", {500, 500});
  const auto found = tibia.measured({{"L", {{0, 2, 0}, 0.05 * Eigen::Matrix3d::Identity()}}});
  ASSERT_EQ(found.size(), 1U);
  const auto& positions = found[0].measure.positions;
  EXPECT_NEAR(positions.at(0).percent[0], 40, 1e-9);
  EXPECT_NEAR(positions.at(0).covariance(0, 0), 0, 1e-12);
  // 0.09 mm^2 along 45 mm, and the rotation's part.
  EXPECT_NEAR(std::sqrt(positions.at(1).covariance(0, 0)), 100 * 0.3 / 45, 1e-3);
  EXPECT_TRUE(found[0].laterals.at(0).is_lateral);
}

TEST(BoneMeasures, ALocatedPointHasTheErrorOfTheModelsSizeAsAPlannedOneHas) {
  Tibia tibia(plateau);
  registration::Registration& found = tibia.model.registration;
  found.scale_sigma = 0.005;
  found.by_scale << 0, 0, 0, 0.02, -0.05, 0.1;
  found.covariance += found.by_scale * found.by_scale.transpose();
  CaseRegistration result;
  result.models.push_back(tibia.model);
  const auto posed = *posed_models_from(to_json(result), "registration.json");
  const Eigen::Vector3d at(10, 40, -20);
  const measures::Landmark carried = in_model("L", {at, Eigen::Matrix3d::Zero()}, posed.at(0));
  EXPECT_LT((carried.covariance_mm2 - registration::point_covariance(found, at)).norm(), 1e-9);
  // Of a file that does not say how the pose answers to the size, the two count apart.
  PosedModel earlier = posed.at(0);
  earlier.by_scale.setZero();
  const Eigen::Matrix3d apart = registration::point_covariance(found.covariance, found.centre, at) +
                                0.005 * 0.005 * at * at.transpose();
  EXPECT_LT((in_model("L", {at, Eigen::Matrix3d::Zero()}, earlier).covariance_mm2 - apart).norm(), 1e-9);
}

TEST(BoneMeasures, WhatWasNotLocatedIsNamed) {
  Tibia tibia(plateau + "t,tibia_ap,tibia,L,,,\n");
  tibia.pick("L", {500, 500});
  const auto found = tibia.measured();
  EXPECT_EQ(found.at(0).missing, std::vector<std::string>{"L"});
  EXPECT_TRUE(found[0].measure.positions.empty());
}

TEST(BoneMeasures, PerCentOfPickedLandmarksStandBeside) {
  Tibia tibia(plateau + "t,tibia_ap,tibia,FS,,,\n");
  const geometry::View view = lateral_view();
  tibia.pick("anterior", view.project({0, 20, 0}));
  EXPECT_TRUE(tibia.measured().at(0).clicked.empty());
  // Clicked 5 mm too far: the point lies at 45 %.
  tibia.pick("posterior", view.project({0, -20, 0}));
  const auto found = tibia.measured();
  ASSERT_EQ(found.at(0).clicked.size(), 1U);
  EXPECT_EQ(found[0].clicked[0].view, "LAT");
  EXPECT_NEAR(found[0].clicked[0].positions.at(0).percent[0], 45, 1e-6);
}

TEST(BoneMeasures, EveryInterfaceHasTheSameFiguresAndWords) {
  Tibia tibia(plateau + "t,tibia_ap,tibia,FS,,,\n");
  tibia.model.measures = tibia.measured();
  CaseRegistration result;
  result.loaded.views.emplace_back().name = "LAT";
  result.loaded.views[0].view = lateral_view();
  result.models.push_back(tibia.model);
  const Json json = to_json(result);
  EXPECT_EQ(json["models"][0]["measures"][0], measures::to_json(tibia.model.measures[0]));
  const report::Table table = measures_table(result.models);
  const auto& position = tibia.model.measures[0].measure.positions[0];
  EXPECT_EQ("FS" + (" " + table.rows.at(0).at(3).text),
            measures::sentence_of(measures::Kind::tibia_ap, position));
  // The file's numbers give the same again.
  Json saved = json;
  saved["models"][0]["points"] = Json::array({{{"name", "FS"}, {"xyz_mm", {0, 2, 0}}}});
  BoneScene scene{*posed_models_from(saved, "registration.json"),
                  {},
                  {SceneView{{"LAT", lateral_view()}, {}}},
                  *measures::zones_of({})};
  const auto sets = *measures::read_landmark_table(*tibia.the_case.models[0].measures);
  EXPECT_EQ(measures::to_json(*measured_in_bone(sets.at(0), scene)), json["models"][0]["measures"][0]);
}

/// The view as if the bone, which moved by `motion` after the first acquisition, had stayed.
geometry::View of_bone_at_first(geometry::View view, const geometry::RigidTransform& motion) {
  view.camera_from_world = view.camera_from_world * motion;
  return view;
}

TEST(BoneMeasures, OfAFileABoneIsWhereItWasInEachView) {
  // Between the acquisitions the tibia turns by 10 degrees: its axis then points away from the beam.
  const geometry::RigidTransform motion{
      Eigen::AngleAxisd(EIGEN_PI / 18, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {3, 0, 0}};
  Tibia tibia(plateau + "t,tibia_ap,tibia,FS,,,\n");
  CaseRegistration result;
  for (const char* name : {"LAT", "LATER"}) result.loaded.views.emplace_back().name = name;
  for (auto& view : result.loaded.views) view.view = lateral_view();
  tibia.model.moves_with = "tibia";
  tibia.model.views = {lateral_view(), of_bone_at_first(lateral_view(), motion)};
  result.models.push_back(tibia.model);
  Json saved = to_json(result);
  saved["models"][0]["points"] = Json::array({{{"name", "FS"}, {"xyz_mm", {0, 2, 0}}}});
  BoneScene scene{*posed_models_from(saved, "registration.json"),
                  {},
                  {SceneView{{"LAT", lateral_view()}, {}}, SceneView{{"LATER", lateral_view()}, {}}},
                  *measures::zones_of({})};
  const auto set = measures::read_landmark_table(*tibia.the_case.models[0].measures)->at(0);
  const auto found = measured_in_bone(set, scene);
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->laterals.size(), 2U);
  EXPECT_LT(found->laterals[0].lateral.off_deg, 0.1);
  EXPECT_NEAR(found->laterals[1].lateral.off_deg, 10, 0.5);
  EXPECT_FALSE(found->laterals[1].is_lateral);
  // Where the bone was in another view is not known.
  scene.views[1].name = "elsewhere";
  EXPECT_THAT(measured_in_bone(set, scene).error().message,
              HasSubstr("\"elsewhere\": \"tibia\" moves with a bone's marker"));
  // Of a bone that did not move it is.
  saved["models"][0]["acquisitions"] = Json::array();
  scene.models = *posed_models_from(saved, "registration.json");
  EXPECT_TRUE(measured_in_bone(set, scene)->laterals.at(1).is_lateral);
}

/// The tibia registered in "LAT", with its own table; `tracked`: with a marker, 40 mm from it.
struct RegisteredTibia {
  static constexpr double marker_mm = 40;
  Tibia tibia{plateau + "t,tibia_ap,tibia,FS,,,\n"};
  BoneScene scene;

  explicit RegisteredTibia(bool tracked, const std::string& rows = {}) {
    CaseRegistration result;
    result.loaded.views.emplace_back().name = "LAT";
    result.loaded.views[0].view = lateral_view();
    if (tracked) {
      tibia.model.moves_with = "tibia";
      tibia.model.world_from_bone = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {marker_mm, 0, 0}};
    }
    result.models.push_back(tibia.model);
    Json saved = to_json(result);
    saved["models"][0]["points"] = Json::array({{{"name", "FS"}, {"xyz_mm", {0, 2, 0}}}});
    scene.models = *posed_models_from(saved, "registration.json");
    scene.zones = *measures::zones_of({});
    EXPECT_TRUE(write_file(tibia.folder.path() / "rows.csv", head + plateau + rows));
  }
  Expected<measures::InBone> measured() const {
    return measured_in_bone(measures::read_landmark_table(tibia.folder.path() / "rows.csv")->at(0), scene);
  }
  /// A later image of the same name by a C-arm that was moved, of the bone turned about its own axis.
  void take_later(double turn_deg, bool with_marker) {
    const geometry::RigidTransform motion{
        Eigen::AngleAxisd(turn_deg * EIGEN_PI / 180, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
        {30, 9, 0}};
    geometry::View view = lateral_view();
    view.camera_from_world = view.camera_from_world * motion.inverse();
    SceneView later{{"LAT", view}};
    if (with_marker) later.world_from_bone["tibia"] = motion * *tibia.model.world_from_bone;
    scene.views = {later};
  }
};

TEST(BoneMeasures, InLaterImagesABoneIsWhereItsMarkerWas) {
  RegisteredTibia of(true);
  of.take_later(10, true);
  const auto found = of.measured();
  ASSERT_TRUE(found) << found.error().message;
  // The C-arm went with the bone.
  ASSERT_EQ(found->laterals.size(), 1U);
  EXPECT_LT(found->laterals[0].lateral.off_deg, 1e-6);
  of.scene.views[0].view = lateral_view();  // it stayed
  EXPECT_NEAR(of.measured()->laterals.at(0).lateral.off_deg, 10, 1);
}

TEST(BoneMeasures, LaterImagesWithoutTheMarkersPoseAreRefused) {
  RegisteredTibia of(true);
  of.take_later(0, false);
  EXPECT_THAT(of.measured().error().message, HasSubstr("its camera is 31.3 mm and 0.0 degrees"));
  of.scene.views[0].name = "later";
  EXPECT_THAT(of.measured().error().message, HasSubstr("has no pose of that marker then"));
}

TEST(BoneMeasures, OfABoneWithoutAMarkerImagesOfTheSameNameMustBeTheRegistered) {
  RegisteredTibia of(false);
  of.scene.views = {SceneView{{"LAT", lateral_view()}, {}}};
  of.scene.views[0].view.camera_from_world.translation.x() += 1;  // another prior
  EXPECT_TRUE(of.measured());
  of.take_later(0, false);
  EXPECT_THAT(of.measured().error().message, HasSubstr("give both cases the poses of the marker"));
  of.scene.models[0].cameras.clear();  // a file of an earlier version
  EXPECT_TRUE(of.measured());
}

TEST(BoneMeasures, APointThatIsLocatedInOtherImagesIsRefused) {
  RegisteredTibia of(true, "t,tibia_ap,tibia,L,,,\n");
  of.scene.located["L"] = {{0, 2, 0}, Eigen::Matrix3d::Identity()};
  EXPECT_TRUE(of.measured());
  of.take_later(10, true);
  EXPECT_THAT(of.measured().error().message, HasSubstr("\"L\" was located in other images"));
}

TEST(BoneMeasures, BadTablesAreRefusedBeforeTheRegistration) {
  const auto refusal = [](const std::string& rows) {
    Tibia tibia(rows);
    return guarded([&] { read_measures(tibia.the_case, tibia.plans); }).error().message;
  };
  EXPECT_THAT(refusal(plateau + "t,tibia_ap,tibia,nowhere,,,\n"),
              HasSubstr("row 5: \"nowhere\" has no coordinates"));
  EXPECT_THAT(refusal("t,tibia_ap,femur,anterior,0,20,0\n"), HasSubstr("has no row with this model"));
  EXPECT_THAT(refusal("t,tibia_ap,tibia,anterior,0,20,0\n"), HasSubstr("\"axis_medial\" is missing"));
}

TEST(BoneMeasures, ARefusedModelHasNone) {
  Tibia tibia(plateau + "t,tibia_ap,tibia,FS,,,\n");
  tibia.model.registration.failure = Failure{Reason::wrong_model, "", "", {}};
  EXPECT_TRUE(tibia.measured().empty());
}

}  // namespace bone_measures_test
}  // namespace helicarm::case_registration
