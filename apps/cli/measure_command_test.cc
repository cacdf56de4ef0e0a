// SPDX-License-Identifier: Apache-2.0
#include "measure_command.h"

#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::cli {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

const geometry::View lateral{{6000, 6000, 512, 500, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 800}}};

/// One view, the located point FS, and two fiducials about the calibrator's origin.
Json measured_result_json(const geometry::View& seen_in) {
  Json view{{"name", "LAT"}};
  view["rectification"] = {{"map", rectification::to_json(rectification::identity_map(1024, 1024, 0.2))}};
  view["projection"] = geometry::json_rows(seen_in.projection());
  view["camera_from_calibrator"] = geometry::json_rows(seen_in.camera_from_world.matrix());
  const Json point{{"name", "FS"},
                   {"xyz_mm", {4, 3, 20}},
                   {"covariance_mm2", geometry::json_rows(0.01 * Eigen::Matrix3d::Identity())}};
  Json seen = point;
  seen["name"] = "TE";
  seen["seen"] = {{"LAT", {{"uv_raw", {160, 500}}, {"uv", {160, 500}}, {"sigma_px", 0.4}}}};
  Json missed = seen;
  missed["name"] = "missed";
  missed["warnings"] = {{{"code", "residual_too_large"}}};
  return {{"format", "helicarm-result/1"},
          {"status", "ok"},
          {"views", {view}},
          {"points",
           {point, seen, missed, {{"name", "lost"}, {"xyz_mm", nullptr}, {"covariance_mm2", nullptr}}}}};
}

struct Measured {
  CommandResult result;
  std::string text;
  Json measures() const { return (*parse_json(text, "out"))["measures"]; }
};

Measured measured(const std::string& rows, MeasureArguments arguments = {}, bool calibrated = true,
                  bool as_json = true, const geometry::View& seen_in = lateral) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("helicarm_measure_{}", ::getpid());
  EXPECT_TRUE(write_file(folder / "result.json", measured_result_json(seen_in).dump()));
  EXPECT_TRUE(write_file(folder / "clicks.csv", "measure,kind,view,name,u_px,v_px,sigma_px\n" + rows));
  arguments.clicks = folder / "clicks.csv";
  if (calibrated) arguments.calibration = folder / "result.json";
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = as_json;
  auto result = measure_command(arguments, console);
  fs::remove_all(folder);
  return {std::move(result), out.str()};
}

const std::string distance = "d,distance,LAT,from,100,100,0.5\nd,distance,LAT,to,400,500,0.5\n";
const std::string quadrants =
    "q,femoral_quadrants,LAT,blumensaat_posterior,400,500,0.5\n"
    "q,femoral_quadrants,LAT,blumensaat_anterior,800,500,0.5\n"
    "q,femoral_quadrants,LAT,inferior,600,700,0.5\n"
    "q,femoral_quadrants,LAT,FS,,,\n";

TEST(MeasureCommand, AMirroredViewHasItsReceiverBehindThePlane) {
  geometry::View mirrored = lateral;
  mirrored.intrinsics.fx *= -1;
  MeasureArguments at_depth;
  at_depth.depth_mm = 600;
  const Measured found = measured(distance, at_depth, true, true, mirrored);
  ASSERT_TRUE(found.result) << found.result.error().message;
  EXPECT_NEAR(found.measures()[0]["quantities"][0]["value"].get<double>(), 50, 1e-9);
}

TEST(MeasureCommand, LengthsAreInMillimetresOfThePlane) {
  MeasureArguments at_depth;
  at_depth.depth_mm = 600;
  EXPECT_NEAR(measured(distance, at_depth).measures()[0]["quantities"][0]["value"].get<double>(), 50, 1e-9);
  MeasureArguments at_point;
  at_point.at = "FS";
  const Json at_fs = measured(distance, at_point).measures()[0];
  EXPECT_NEAR(at_fs["depth_mm"].get<double>(), 820, 1e-9);
  EXPECT_NEAR(at_fs["quantities"][0]["value"].get<double>(), 500 * 820 / 6000., 1e-9);
}

TEST(MeasureCommand, PositionOutsideTheLandmarksIsWarnedOf) {
  const std::string rows =
      "t,tibia_ap,LAT,anterior,500,100,0.5\nt,tibia_ap,LAT,posterior,900,100,0.5\nt,tibia_ap,LAT,X,400,100,0."
      "5\n";
  const Json warnings = measured(rows, {}, false).measures()[0]["warnings"]["X"];
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0]["code"], "outside_reference");
  EXPECT_THAT(measured(rows, {}, false, false).text, HasSubstr("\"X\" with \"anterior\" (20.0 %)"));
}

TEST(MeasureCommand, LengthsAreInPixelsWithoutACalibration) {
  const Json length = measured(distance, {}, false).measures()[0]["quantities"][0];
  EXPECT_EQ(length["unit"], "px");
  EXPECT_NEAR(length["value"].get<double>(), 500, 1e-9);
}

TEST(MeasureCommand, LocatedPointIsGivenInPerCent) {
  const Json position = measured(quadrants).measures()[0]["positions"][0];
  const Eigen::Vector2d uv = lateral.project({4, 3, 20});
  EXPECT_EQ(position["point"], "FS");
  EXPECT_NEAR(position["percent"]["depth"].get<double>(), (uv.x() - 400) / 4, 1e-9);
  EXPECT_NEAR(position["percent"]["height"].get<double>(), (uv.y() - 500) / 2, 1e-9);
  EXPECT_EQ(position["covariance_percent2"].size(), 2u);
}

TEST(MeasureCommand, PointSeenInTheViewIsItsImage) {
  const Json position = measured(
                            "q,tibia_ml,LAT,medial,100,500,0\nq,tibia_ml,LAT,lateral,300,500,0\n"
                            "q,tibia_ml,LAT,TE,,,\n")
                            .measures()[0]["positions"][0];
  EXPECT_NEAR(position["percent"]["from_medial"].get<double>(), 30, 1e-9);
  EXPECT_NEAR(position["covariance_percent2"][0][0].get<double>(), 0.04, 1e-9);
}

TEST(MeasureCommand, PointWhoseRaysMissIsItsProjection) {
  const Json position = measured(
                            "q,tibia_ml,LAT,medial,100,500,0\nq,tibia_ml,LAT,lateral,300,500,0\n"
                            "q,tibia_ml,LAT,missed,,,\n")
                            .measures()[0]["positions"][0];
  EXPECT_NEAR(position["percent"]["from_medial"].get<double>(), (lateral.project({4, 3, 20}).x() - 100) / 2,
              1e-9);
}

TEST(MeasureCommand, WarningsOfALocatedPointStandWithTheMeasure) {
  const std::string rows =
      "q,tibia_ml,LAT,medial,100,500,0\nq,tibia_ml,LAT,lateral,300,500,0\nq,tibia_ml,LAT,missed,,,\n";
  EXPECT_EQ(measured(rows).measures()[0]["warnings"]["missed"][0]["code"], "residual_too_large");
  EXPECT_THAT(measured(rows, {}, true, false).text, HasSubstr("warning: missed: residual_too_large"));
}

TEST(MeasureCommand, PlaneBehindTheReceiverIsRefused) {
  MeasureArguments arguments;
  arguments.depth_mm = 1201;  // 6000 px of 0.2 mm
  const Measured behind = measured(distance, arguments);
  ASSERT_FALSE(behind.result);
  EXPECT_THAT(behind.result.error().message, HasSubstr("1200 mm from the source"));
}

/// The positions of a planned point at FS, of a femur that is shifted by this along x at the acquisition of
/// LAT.
Json of_planned_point(double shift_mm) {
  const fs::path file = fs::temp_directory_path() / fmt::format("helicarm_registration_{}.json", ::getpid());
  const auto shifted = [](double by) {
    return geometry::json_rows(geometry::RigidTransform{Eigen::Matrix3d::Identity(), {by, 0, 0}}.matrix());
  };
  const Json planned{{"name", "planned"},
                     {"xyz_mm", {4 - shift_mm, 3, 20}},
                     {"covariance_mm2", geometry::json_rows(0.01 * Eigen::Matrix3d::Identity())}};
  const Json femur{{"name", "femur"},
                   {"decision", "accept"},
                   {"world_from_model", shifted(0)},
                   {"covariance", geometry::json_rows(1e-6 * Eigen::Matrix<double, 6, 6>::Identity())},
                   {"centre_mm", {0, 0, 0}},
                   {"points", {planned}},
                   {"acquisitions",
                    {{{"view", "AP"}, {"world_from_model", shifted(0)}},
                     {{"view", "LAT"}, {"world_from_model", shifted(shift_mm)}}}}};
  EXPECT_TRUE(write_file(file, Json{{"models", {femur}}}.dump()));
  MeasureArguments arguments;
  arguments.registration = file;
  std::string rows = quadrants;
  rows.replace(rows.find("FS,,,"), 2, "planned");
  const Json positions = measured(rows, arguments).measures()[0]["positions"][0];
  fs::remove(file);
  return positions;
}

TEST(MeasureCommand, PlannedPointOfARegistrationIsGivenInPerCent) {
  EXPECT_EQ(of_planned_point(0)["percent"], measured(quadrants).measures()[0]["positions"][0]["percent"]);
}

TEST(MeasureCommand, APlannedPointIsWhereItsBoneWasInTheImage) {
  const Json moved = of_planned_point(9)["percent"], here = of_planned_point(0)["percent"];
  for (const char* part : {"depth", "height"})
    EXPECT_NEAR(moved[part].get<double>(), here[part].get<double>(), 1e-9);
}

TEST(MeasureCommand, TableNamesPlaneAndSigma) {
  MeasureArguments at_depth;
  at_depth.depth_mm = 600;
  EXPECT_THAT(
      measured(distance, at_depth, true, false).text,
      testing::AllOf(HasSubstr("length 50.00 mm, sigma 0.07"), HasSubstr("600.0 mm from the source")));
}

TEST(MeasureCommand, RefusalsNameTheRow) {
  const auto refusal = [](const std::string& rows, bool calibrated = true) {
    const Measured answer = measured(rows, {}, calibrated);
    return answer.result ? "accepted" : answer.result.error().message;
  };
  EXPECT_THAT(refusal("d,length,LAT,from,1,2,\n"), HasSubstr("row 1: kind: \"length\""));
  EXPECT_THAT(refusal("d,distance,AP,from,1,2,\n"), HasSubstr("no view \"AP\""));
  EXPECT_THAT(refusal("q,tibia_ml,LAT,lost,,,\n"), HasSubstr("no located point \"lost\""));
  EXPECT_THAT(refusal("q,tibia_ml,LAT,FS,,,\n", false), HasSubstr("needs --calibration"));
  EXPECT_THAT(refusal("q,tibia_ml,LAT,FS,100,,\n"), HasSubstr("row 1: u_px, v_px: both or none"));
  EXPECT_THAT(refusal("q,tibia_ml,LAT,FS,,100,\n"), HasSubstr("row 1: u_px, v_px: both or none"));
  EXPECT_THAT(refusal("d,distance,LAT,from,1,2,\n"), HasSubstr("measure \"d\": distance: \"to\" is missing"));
  EXPECT_THAT(refusal("d,distance,LAT,from,1024.5,2,\n"), HasSubstr("not in the rectified image of LAT"));
  EXPECT_THAT(refusal(distance + "d,angle,LAT,vertex,1,2,\n"), HasSubstr("another kind"));
}

/// Landmarks of a femur in its CT, which lies turned by 90 degrees about z in the calibrator's frame.
struct InSpace {
  CommandResult result;
  std::string text;
};

InSpace in_space(const std::string& rows, bool as_json = true, const std::string& zones = {}) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("helicarm_in_space_{}", ::getpid());
  const Json zero = geometry::json_rows(Eigen::Matrix<double, 6, 6>::Zero());
  const Json turned = {{0, 0, 1, 0}, {1, 0, 0, 0}, {0, 1, 0, 20}, {0, 0, 0, 1}};
  const Json planned{{"name", "planned_start"},
                     {"xyz_mm", {-7, -20, 7.5}},
                     {"covariance_mm2", geometry::json_rows(Eigen::Matrix3d::Identity())}};
  const Json model{{"name", "femur"},    {"decision", "accept"},    {"world_from_model", turned},
                   {"covariance", zero}, {"centre_mm", {0, 0, 20}}, {"points", {planned}}};
  EXPECT_TRUE(write_file(folder / "result.json", measured_result_json(lateral).dump()));
  EXPECT_TRUE(write_file(folder / "registration.json", Json{{"models", {model}}}.dump()));
  EXPECT_TRUE(
      write_file(folder / "landmarks.csv", "measure,kind,model,name,x_mm,y_mm,z_mm,sigma_mm\n" + rows));
  EXPECT_TRUE(write_file(folder / "zones.json", zones));
  MeasureArguments arguments;
  arguments.landmarks = folder / "landmarks.csv";
  arguments.calibration = folder / "result.json";
  arguments.registration = folder / "registration.json";
  if (!zones.empty()) arguments.zones = folder / "zones.json";
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = as_json;
  auto result = measure_command(arguments, console);
  return {std::move(result), out.str()};
}

const std::string femur_in_ct =
    "q,femoral_quadrants,femur,axis_medial,-45,-25,-20,0.5\n"
    "q,femoral_quadrants,femur,axis_lateral,5,-25,-20,0.5\n"
    "q,femoral_quadrants,femur,blumensaat_posterior,0,-20,0,0.5\n"
    "q,femoral_quadrants,femur,blumensaat_anterior,-3,20,0,0.5\n"
    "q,femoral_quadrants,femur,inferior,8,3,-25,0.5\n"
    "q,femoral_quadrants,femur,posterior,6,-25,-10,0.5\n"
    "q,femoral_quadrants,femur,anterior,7,25,-4,0.5\n";

TEST(MeasureLandmarks, APlannedPointIsGivenInQuadrantsBesidePublishedZones) {
  const InSpace done = in_space(femur_in_ct + "q,femoral_quadrants,femur,planned_start,,,,\n");
  ASSERT_TRUE(done.result) << done.result.error().message;
  const Json measure = (*parse_json(done.text, "out"))["measures"][0];
  // In the model the point lies at (-20, -12.5, -7).
  EXPECT_NEAR(measure["positions"][0]["percent"]["depth"].get<double>(), 25, 1e-9);
  EXPECT_NEAR(measure["positions"][0]["percent"]["height"].get<double>(), 28, 1e-9);
  EXPECT_EQ(measure["positions"][0]["zones"].size(), 2U);
  EXPECT_NEAR(measure["positions"][0]["zones"][0]["from_centre_percent"]["depth"].get<double>(), 0.2, 1e-9);
}

TEST(MeasureLandmarks, AViewBesideTheTrueLateralOneIsNamed) {
  // The view looks along z, the model's y.
  const std::string rows =
      "t,tibia_ap,femur,axis_medial,8,-30,0,0\nt,tibia_ap,femur,axis_lateral,-4,30,0,0\n"
      "t,tibia_ap,femur,anterior,0,0,20,0\nt,tibia_ap,femur,posterior,0,0,-30,0\nt,tibia_ap,femur,FS,,,,\n";
  const InSpace done = in_space(rows);
  ASSERT_TRUE(done.result) << done.result.error().message;
  const Json view = (*parse_json(done.text, "out"))["measures"][0]["laterals"][0];
  EXPECT_EQ(view["view"], "LAT");
  EXPECT_NEAR(view["off_deg"].get<double>(), 11.3, 0.3);  // the axis lies beside the central ray
  EXPECT_NEAR(view["apart_mm"].get<double>(), 12, 1);
  EXPECT_FALSE(view["is_lateral"]);
  EXPECT_THAT(in_space(rows, false).text, HasSubstr("this image is no lateral one"));
}

TEST(MeasureLandmarks, ZonesOfAFileReplaceTheBuiltInOnes) {
  const InSpace done =
      in_space(femur_in_ct + "q,femoral_quadrants,femur,P,-20,-12.5,-7,\n", true,
               R"({"format": "helicarm-zones/1", "zones": [{"kind": "femoral_quadrants", "name": "mine",
                   "source": "our clinic", "depth": {"low": 40, "high": 50}}]})");
  ASSERT_TRUE(done.result) << done.result.error().message;
  const Json zone = (*parse_json(done.text, "out"))["measures"][0]["positions"][0]["zones"][0];
  EXPECT_EQ(zone["name"], "mine");
  EXPECT_TRUE(zone["outside"]);
}

TEST(MeasureLandmarks, WhatIsMissingIsNamed) {
  EXPECT_THAT(in_space(femur_in_ct + "q,femoral_quadrants,femur,nowhere,,,,\n").result.error().message,
              HasSubstr("\"nowhere\" has no coordinates"));
  EXPECT_THAT(in_space("q,femoral_quadrants,tibia,FS,,,,\n").result.error().message,
              HasSubstr("no registered model"));
  EXPECT_THAT(in_space("q,quadrants,femur,FS,1,2,3,\n").result.error().message, HasSubstr("is none of"));
  std::ostringstream out, progress;
  Console console{out, progress};
  EXPECT_EQ(measure_command({}, console).error().reason, Reason::usage);
}

}  // namespace
}  // namespace helicarm::cli
