// SPDX-License-Identifier: Apache-2.0
#include "locate_command.h"

#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::cli {
namespace {
namespace fs = std::filesystem;

geometry::View view_at(double alpha) {
  return {{6000, 6000, 512, 500, 0}, {geometry::rotation_from_euler(alpha, 0, 0), {0, 0, 800}}};
}

Json result_json() {
  Json views = Json::array();
  for (const auto& [name, alpha] : {std::pair{"AP", 0.0}, {"LAT", 1.5}}) {
    Json view{{"name", name}};
    view["rectification"] = {
        {"map", rectification::to_json(rectification::identity_map(1024, 1024, std::nullopt))}};
    view["projection"] = geometry::json_rows(view_at(alpha).projection());
    view["camera_from_calibrator"] = geometry::json_rows(view_at(alpha).camera_from_world.matrix());
    views.push_back(view);
  }
  return {{"format", "helicarm-result/1"}, {"status", "ok"}, {"views", views}};
}

struct Answer {
  CommandResult result;
  Json json;
};

Answer locate_in(const Json& calibration, const std::string& picks, bool raw = false) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("helicarm_locate_{}", ::getpid());
  EXPECT_TRUE(write_file(folder / "result.json", calibration.dump()));
  EXPECT_TRUE(write_file(folder / "picks.csv", picks));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  auto result = locate_command({{(folder / "result.json").string()}, folder / "picks.csv", raw}, console);
  fs::remove_all(folder);
  Json json = result ? *parse_json(out.str(), "out") : Json();
  return {std::move(result), std::move(json)};
}

std::string picks_of(const Eigen::Vector3d& point) {
  const Eigen::Vector2d a = view_at(0).project(point), b = view_at(1.5).project(point);
  return fmt::format("name,view,u_px,v_px,sigma_px\nT,AP,{},{},0.3\nT,LAT,{},{},0.3\nlonely,AP,5,5,\n", a.x(),
                     a.y(), b.x(), b.y());
}

TEST(LocateCommand, PointsAndReasonsKeepTheOrderOfThePicks) {
  for (bool raw : {false, true}) {
    const Answer answer = locate_in(result_json(), picks_of({10, 20, 30}), raw);
    ASSERT_TRUE(answer.result.has_value()) << answer.result.error().message;
    const Json& points = answer.json["points"];
    ASSERT_EQ(points.size(), 2u);
    EXPECT_NEAR(points[0]["xyz_mm"][2].get<double>(), 30, 1e-6);
    EXPECT_EQ(points[0]["views"], (Json{"AP", "LAT"}));
    EXPECT_TRUE(points[0]["reason"].is_null());
    EXPECT_TRUE(points[1]["xyz_mm"].is_null());
    EXPECT_EQ(points[1]["reason"], "not_seen");
  }
}

TEST(LocateCommand, RaysThatMissAreWarnedOfAtThePointAlsoWithImportedCameras) {
  const Eigen::Vector2d a = view_at(0).project({10, 20, 30}), b = view_at(1.5).project({10, 20, 30});
  const Answer answer = locate_in(result_json(), fmt::format("name,view,u_px,v_px\nT,AP,{},{}\nT,LAT,{},{}\n",
                                                             a.x() + 120, a.y(), b.x(), b.y()));
  ASSERT_TRUE(answer.result.has_value());
  const Json& point = answer.json["points"][0];
  ASSERT_EQ(point["warnings"].size(), 1u);
  EXPECT_EQ(point["warnings"][0]["code"], "residual_too_large");
  EXPECT_EQ(answer.json["warnings"], point["warnings"]);
  EXPECT_GT(point["ray_gap_mm"].get<double>(), 10);
  EXPECT_GE(point["error_95_mm"].get<double>(), 0.5 * point["ray_gap_mm"].get<double>());
}

TEST(LocateCommand, PickOffTheRectifiedImageIsNamedWhereOtherViewsLocateThePoint) {
  Json result = result_json();
  Json third = result["views"][0];
  third["name"] = "OBL";
  result["views"].push_back(third);
  const Eigen::Vector2d a = view_at(0).project({10, 20, 30}), b = view_at(1.5).project({10, 20, 30});
  const Answer answer =
      locate_in(result, fmt::format("name,view,u_px,v_px\nT,OBL,5000,300\nT,AP,{},{}\nT,LAT,{},{}\n", a.x(),
                                    a.y(), b.x(), b.y()));
  ASSERT_TRUE(answer.result) << answer.result.error().message;
  const Json& point = answer.json["points"][0];
  EXPECT_FALSE(point["xyz_mm"].is_null());
  ASSERT_EQ(point["warnings"].size(), 1u);
  EXPECT_EQ(point["warnings"][0]["code"], "not_seen");
  EXPECT_NE(point["warnings"][0]["message"].get<std::string>().find("row 1: 5000, 300"), std::string::npos);
}

TEST(LocateCommand, RaysThatMissAreWarnedOfWithoutACovarianceToo) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("helicarm_locate_{}", ::getpid());
  std::vector<std::string> cameras;
  for (const auto& [name, alpha] : {std::pair{"AP", 0.0}, {"LAT", 1.5}}) {
    const fs::path file = folder / fmt::format("{}.json", name);
    EXPECT_TRUE(
        write_file(file, Json{{"projection", geometry::json_rows(view_at(alpha).projection())}}.dump()));
    cameras.push_back(fmt::format("{}={}", name, file.string()));
  }
  const Eigen::Vector2d a = view_at(0).project({10, 20, 30}), b = view_at(1.5).project({10, 20, 30});
  EXPECT_TRUE(write_file(folder / "picks.csv", fmt::format("name,view,u_px,v_px\nT,AP,{},{}\nT,LAT,{},{}\n",
                                                           a.x() + 400, a.y(), b.x(), b.y())));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  const auto result = locate_command({cameras, folder / "picks.csv", false}, console);
  fs::remove_all(folder);
  ASSERT_TRUE(result) << result.error().message;
  const Json point = (*parse_json(out.str(), "out"))["points"][0];
  ASSERT_EQ(point["warnings"].size(), 2u);
  EXPECT_EQ(point["warnings"][0]["code"], "residual_too_large");
  EXPECT_EQ(point["warnings"][1]["code"], "covariance_missing");
  EXPECT_TRUE(point["covariance_mm2"].is_null());
}

TEST(LocateCommand, PickOnABallOfTheResultsCalibratorIsNotLocated) {
  Json result = result_json();
  result["calibrator"] = {{"balls", {{{"label", "P7"}, {"xyz_mm", {10, 20, 30}}, {"diameter_mm", 4}}}}};
  const Json answer = locate_in(result, picks_of({10.5, 20, 30})).json;
  const Json& on_ball = answer["warnings"];
  EXPECT_TRUE(answer["points"][0]["xyz_mm"].is_null());
  EXPECT_EQ(answer["points"][0]["reason"], "pick_on_fiducial");
  ASSERT_EQ(on_ball.size(), 1u);
  EXPECT_EQ(on_ball[0]["code"], "pick_on_fiducial");
  EXPECT_NE(on_ball[0]["message"].get<std::string>().find("P7 in AP"), std::string::npos);
  EXPECT_TRUE(locate_in(result, picks_of({15, 20, 30})).json["warnings"].empty());
}

TEST(LocateCommand, EachPointHasTheNoteOfUnobservableMotion) {
  const Answer answer = locate_in(result_json(), picks_of({10, 20, 30}));
  ASSERT_EQ(answer.json["notes"].size(), 1u);  // not the point that is not located
  EXPECT_EQ(answer.json["notes"][0]["code"], "unobservable_motion");
  EXPECT_EQ(answer.json["points"][0]["notes"], answer.json["notes"]);
  EXPECT_TRUE(answer.json["points"][1]["notes"].empty());
}

TEST(LocateCommand, CovarianceOfTheCalibrationAddsToThatOfThePoint) {
  Json calibrated = result_json();
  calibrated["calibration"]["joint_covariance"] =
      geometry::json_rows(1e-4 * Eigen::MatrixXd::Identity(22, 22));
  const double with =
      locate_in(calibrated, picks_of({10, 20, 30})).json["points"][0]["predicted_mm"].get<double>();
  const double without =
      locate_in(result_json(), picks_of({10, 20, 30})).json["points"][0]["predicted_mm"].get<double>();
  EXPECT_GT(with, 2 * without);
  calibrated["calibration"]["joint_covariance"] = geometry::json_rows(Eigen::MatrixXd::Identity(11, 11));
  EXPECT_EQ(locate_in(calibrated, picks_of({10, 20, 30})).result.error().reason, Reason::bad_value);
}

TEST(LocateCommand, BadInputIsNamedInTheMessage) {
  const auto reason_of = [](const Json& calibration, const std::string& picks) {
    return locate_in(calibration, picks).result.error().reason;
  };
  EXPECT_EQ(reason_of(result_json(), "name,view,u_px,v_px\nT,PA,1,2\n"), Reason::bad_value);
  EXPECT_EQ(reason_of(result_json(), "name,view,u_px,v_px\nT\x1b[31m,AP,1,2\n"), Reason::bad_value);
  EXPECT_EQ(locate_in(result_json(), "name,view,u_px,v_px\nT,AP,1,2000\n", true).result.error().reason,
            Reason::bad_value);
  EXPECT_EQ(reason_of(result_json(), "name,view,u_px,v_px\nT,AP,1,2\nT,AP,3,4\n"), Reason::name_clash);
  EXPECT_EQ(reason_of(result_json(), "name,view,u_px,v_px,sigma_px\nT,AP,1,2,-1\n"), Reason::bad_value);
  Json refused = result_json();
  refused["status"] = "refused";
  EXPECT_EQ(reason_of(refused, picks_of({0, 0, 0})), Reason::bad_value);
  Json scaled = result_json();
  scaled["views"][0]["camera_from_calibrator"][0][0] = 3;
  EXPECT_EQ(reason_of(scaled, picks_of({0, 0, 0})), Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::cli
