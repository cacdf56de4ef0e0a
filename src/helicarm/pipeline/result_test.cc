// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/result.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

void expect_keys(const Json& json, std::initializer_list<const char*> keys) {
  for (const char* key : keys) EXPECT_TRUE(json.contains(key)) << key;
}

Result two_views() {
  Result result;
  for (const char* name : {"AP", "LAT"}) {
    ViewResult view;
    view.name = name;
    view.xray_image = std::make_shared<const xray::XrayImage>(
        xray::XrayImage{name, image::Image<float>(8, 6), 0, 4095, {}, {}});
    view.rectification = rectification::Rectification{};
    view.found = fiducials::LabelledFiducials{};
    fiducials::Fiducial fiducial{"P1", Eigen::Vector3d::Zero()};
    fiducial.status = fiducials::FiducialStatus::used;
    view.found->fiducials = {fiducial, {"P2", Eigen::Vector3d::Zero()}};
    view.calibrated = calibration::CalibratedView{};
    view.calibrated->view.intrinsics = {4000, 4000, 4, 3, 0};
    result.views.push_back(std::move(view));
  }
  return result;
}

TEST(ResultJson, HasEveryKeyOfTheContract) {
  Result result = two_views();
  PointResult point{
      "FS", localization::PointSource::pick, {}, {fiducials::ImagePoint{{1, 2}, {3, 4}, 0.1}, {}}, {}, 0, {}};
  point.place = guidance::PointInFrames{};
  result.points.push_back(point);
  result.bones = guidance::knee_bones();
  result.tunnels.push_back({"femur", {}, {}, {}, 30});
  result.verifications.push_back(
      {"drill", guidance::LineError{{1.0, {}}, 1, 2, 3}, guidance::LineError{{1.0, {}}, 1, 2, 3}});
  const Json json = to_json(result);

  expect_keys(json, {"format", "status", "failure", "warnings", "views", "points", "accuracy", "tunnels",
                     "verification", "timing_ms", "version", "options"});
  EXPECT_EQ(json["status"], "ok");
  EXPECT_TRUE(json["failure"].is_null());
  expect_keys(json["views"][0],
              {"name", "image_size", "rectification", "fiducials", "false_blobs", "labelling", "projection",
               "dlt", "intrinsics", "camera_from_calibrator", "reprojection_rms_px", "chi2", "dof"});
  EXPECT_EQ(json["views"][0]["image_size"], Json({8, 6}));
  expect_keys(json["views"][0]["rectification"],
              {"model", "source", "dots_found", "dots_expected", "residual_rms_px", "residual_max_px",
               "held_out_rms_px", "raw_mean_px", "raw_max_px", "rectified_pixel_mm", "rectified_plane"});
  expect_keys(json["views"][0]["fiducials"][0],
              {"label", "status", "uv_raw", "uv", "sigma_px", "residual_px"});
  expect_keys(json["views"][0]["intrinsics"], {"fx_px", "fy_px", "u0", "v0", "f_mm", "pixel_mm"});
  EXPECT_EQ(json["views"][0]["projection"].size(), 3u);
  EXPECT_EQ(json["views"][0]["camera_from_calibrator"].size(), 4u);
  expect_keys(json["points"][0], {"name", "source", "xyz_mm", "frame", "covariance_mm2", "ray_gap_mm",
                                  "views", "reason", "in_bones", "in_femur", "in_tibia", "in_tool"});
  EXPECT_EQ(json["points"][0]["views"], Json({"AP"}));
  expect_keys(json["accuracy"], {"fle_px", "fre_mm", "tre_mm", "targets"});
  expect_keys(json["tunnels"][0], {"name", "in_bones", "start_in_tool", "end_in_tool", "axis_in_tool",
                                   "length_mm", "length_sigma_mm", "axis_sigma_deg", "axis_covariance"});
  expect_keys(json["verification"][0],
              {"name", "start_px", "end_px", "err_start_px", "err_end_px", "err_start_mm", "err_end_mm",
               "distance_start_mm", "distance_end_mm"});
  EXPECT_TRUE(json["verification"][0]["start_px"]["LAT"].is_null());
  expect_keys(json["timing_ms"], {"read", "rectify", "detect", "label", "calibrate", "locate", "total"});
}

TEST(ResultJson, PlacesInBonesAreNamedAsTheCaseNamesThem) {
  Result result = two_views();
  result.bones = {"L4", "pelvis"};
  guidance::PointInFrames place;
  place.in_bones["L4"] = {{{1, 2, 3}, Eigen::Matrix3d::Zero(), {}, {}}, 4 * Eigen::Matrix3d::Identity()};
  result.points.push_back({"entry", localization::PointSource::pick, "L4", {}, place, 0, {}});
  result.tunnels.push_back({"pedicle", {}, {}, {}, 30});
  result.tunnels[0].start_in_bones = result.tunnels[0].end_in_bones = place.in_bones;
  const Json json = to_json(result);
  const Json& in_bone = json["points"][0]["in_bones"]["L4"];
  EXPECT_EQ(in_bone["xyz_mm"], Json({1, 2, 3}));
  EXPECT_EQ(in_bone["covariance_mm2"][1], Json({0, 4, 0}));
  EXPECT_EQ(in_bone["error_95_mm"], localization::length_at_95(4 * Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(json["points"][0]["in_bones"].contains("pelvis"));
  EXPECT_FALSE(json["points"][0].contains("in_femur"));
  EXPECT_EQ(json["tunnels"][0]["in_bones"]["L4"]["end"], in_bone);
}

TEST(ResultJson, FiducialNotFoundHasNoPixels) {
  const Json fiducial = to_json(two_views())["views"][0]["fiducials"][1];
  EXPECT_EQ(fiducial["status"], "not_found");
  EXPECT_TRUE(fiducial["uv"].is_null());
  EXPECT_TRUE(fiducial["uv_raw"].is_null());
}

TEST(ResultJson, PointNotLocatedHasAReason) {
  Result result = two_views();
  result.points.push_back({"T1",
                           localization::PointSource::target,
                           {},
                           {{}, {}},
                           {},
                           0,
                           Failure{Reason::target_not_found, "no ball", "", {}}});
  const Json point = to_json(result)["points"][0];
  EXPECT_TRUE(point["xyz_mm"].is_null());
  EXPECT_EQ(point["reason"], "target_not_found");
}

TEST(ResultJson, RefusalHasFiguresAndViewsNotReachedAreNull) {
  Result result;
  result.views.push_back({"AP", {}, {}, {}, {}});
  result.failure = Failure{Reason::too_few_fiducials, "5 balls", "AP", {{"found", 5}}};
  const Json json = to_json(result);
  EXPECT_EQ(json["status"], "refused");
  EXPECT_EQ(json["failure"]["code"], "too_few_fiducials");
  EXPECT_EQ(json["failure"]["view"], "AP");
  EXPECT_EQ(json["failure"]["figures"]["found"], 5);
  EXPECT_TRUE(json["views"][0]["projection"].is_null());
  EXPECT_TRUE(json["views"][0]["image_size"].is_null());
}

}  // namespace
}  // namespace helicarm::pipeline
