// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/camera_case.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/case_registration/load.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/image/png.h"

namespace helicarm::case_registration {
namespace camera_case_test {

using testing::ElementsAre;
using testing::HasSubstr;

/// Two views across each other with cameras of another program, and picks of the start and the end of a
/// tunnel.
class CameraCase : public testing::Test {
 protected:
  CameraCase() {
    Eigen::Matrix3d lateral;
    lateral << 0, 0, 1, 0, 1, 0, -1, 0, 0;
    add_view("AP", Eigen::Matrix3d::Identity());
    add_view("LAT", lateral);
    pick("start", start_);
    pick("end", end_);
    case_.tunnels = {{"tunnel", "start", "end"}};
  }

  void add_view(const std::string& name, const Eigen::Matrix3d& turn) {
    pipeline::CaseView& view = case_.views.emplace_back();
    view.name = name;
    view.image = folder_.path() / (name + ".png");
    view.camera = folder_.path() / (name + ".txt");
    EXPECT_TRUE(write_file(view.image, image::encode_png(image::Image<std::uint8_t>(201, 101, 100))));
    const Eigen::Vector3d shift = Eigen::Vector3d(0, 0, 800) - turn * middle_;
    std::string camera = "image size\n201,101\n\ncamera matrix\n2000,0,100\n0,2000,50\n0,0,1\n\nrotation\n";
    for (int row = 0; row < 3; ++row)
      camera += fmt::format("{},{},{}\n", turn(row, 0), turn(row, 1), turn(row, 2));
    camera += fmt::format("\ntranslation\n{}\n{}\n{}\n", shift.x(), shift.y(), shift.z());
    EXPECT_TRUE(write_file(*view.camera, camera));
  }
  void pick(const std::string& name, const Eigen::Vector3d& at) {
    for (const pipeline::CaseView& view : case_.views) {
      pipeline::Pick& pick = case_.picks.emplace_back();
      pick.name = name;
      pick.view = view.name;
      pick.uv_raw = exchange::import_matrix(*view.camera)->view.project(at);
    }
  }

  TemporaryFolder folder_;
  const Eigen::Vector3d middle_{10, 20, 30}, start_{14, 22, 21}, end_{8, 13, 37};
  pipeline::Case case_;
};

TEST_F(CameraCase, ItsPicksAreLocatedWithoutErrors) {
  const auto result = measure_with_cameras({}, case_, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->failure);
  ASSERT_EQ(result->points.size(), 2u);
  const pipeline::PointResult& start = result->points[0];
  EXPECT_LT((start.place->in_calibrator - start_).norm(), 1e-6);
  EXPECT_TRUE(start.place->covariance_in_calibrator.hasNaN());
  ASSERT_EQ(start.warnings.size(), 1u);
  EXPECT_EQ(start.warnings[0].reason, Reason::covariance_missing);
  EXPECT_THAT(start.warnings[0].message, HasSubstr("the calibration of AP, LAT has no covariance"));
  ASSERT_EQ(result->tunnels.size(), 1u);
  EXPECT_NEAR(*result->tunnels[0].length_mm, (end_ - start_).norm(), 1e-6);
}

TEST_F(CameraCase, SaysWhatItsCamerasLack) {
  const auto result = measure_with_cameras({}, case_, {}).value();
  const pipeline::Finding& first = result.warnings.front();
  EXPECT_EQ(first.reason, Reason::covariance_missing);
  EXPECT_EQ(first.stage, pipeline::Stage::calibrate);
  EXPECT_THAT(first.message, HasSubstr("AP, LAT: the cameras come without covariance"));
  for (const pipeline::ViewResult& view : result.views) {
    EXPECT_TRUE(view.xray_image && view.rectification && view.calibrated);
    EXPECT_FALSE(view.found) << "no fiducials are looked for";
  }
}

TEST_F(CameraCase, RaysThatMissAreWarnedOfToo) {
  case_.picks[0].uv_raw.y() += 40;
  const auto result = measure_with_cameras({}, case_, {}).value();
  std::vector<Reason> reasons;
  for (const Warning& warning : result.points[0].warnings) reasons.push_back(warning.reason);
  EXPECT_THAT(reasons, ElementsAre(Reason::residual_too_large, Reason::covariance_missing));
  EXPECT_GT(result.points[0].ray_gap_mm, 10);
}

TEST_F(CameraCase, RaysThatMeetDoNotVouchForCamerasByWhichMostOthersMiss) {
  pick("third", {3, 24, 30});
  case_.picks[0].uv_raw.y() += 40;
  case_.picks[2].uv_raw.y() += 40;
  const auto result = measure_with_cameras({}, case_, {}).value();
  EXPECT_EQ(result.points[2].warnings.back().reason, Reason::residual_too_large);
  EXPECT_THAT(result.points[2].warnings.back().message, HasSubstr("the rays of 2 of 3 points miss"));
}

TEST_F(CameraCase, ABadTunnelIsAWarningThatKeepsNoModelFromBeingRegistered) {
  case_.picks[2].uv_raw = case_.picks[0].uv_raw;
  case_.picks[3].uv_raw = case_.picks[1].uv_raw;
  const auto result = measure_with_cameras({}, case_, {}).value();
  EXPECT_FALSE(result.failure);
  EXPECT_TRUE(result.tunnels.empty());
  EXPECT_EQ(result.warnings.back().reason, Reason::bad_tunnel);
}

TEST_F(CameraCase, ToolLinesAreSaidNotToBeCompared) {
  case_.tool_lines.emplace_back();
  const auto result = measure_with_cameras({}, case_, {}).value();
  ASSERT_FALSE(result.notes.empty());
  EXPECT_THAT(result.notes.back().message, HasSubstr("tool_lines"));
}

TEST_F(CameraCase, IsRegisteredToTheViewsThatItsCommandLoads) {
  const auto result = measure_with_cameras({}, case_, {}).value();
  const LoadedViews shown = views_of_calibration(case_, *result.calibration);
  const LoadedViews loaded = load_views(case_, {}).value();
  ASSERT_EQ(shown.views.size(), loaded.views.size());
  EXPECT_EQ(shown.camera_covariance.size(), 0);
  EXPECT_EQ(shown.warnings, loaded.warnings);
  for (std::size_t i = 0; i < shown.views.size(); ++i) {
    EXPECT_EQ(shown.views[i].view.projection(), loaded.views[i].view.projection());
    EXPECT_FALSE(shown.maps[i]) << "free of distortion";
    EXPECT_TRUE(shown.views[i].usable.empty());
  }
}

TEST_F(CameraCase, OtherPicksKeepTheImagesAndCamerasThatWereRead) {
  const auto earlier = measure_with_cameras({}, case_, {}).value();
  std::filesystem::remove(case_.views[0].image);
  case_.picks.resize(2);
  case_.tunnels.clear();
  const auto result = measure_with_cameras(earlier, case_, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->calibration, earlier.calibration);
  EXPECT_EQ(result->points.size(), 1u);
}

TEST_F(CameraCase, WrongInputIsRefusedAsByTheRegistration) {
  const auto refused = [&](const pipeline::Case& wrong) {
    const auto result = measure_with_cameras({}, wrong, {});
    const auto loaded = load_views(wrong, {});
    EXPECT_FALSE(result);
    EXPECT_EQ(result.error().message, loaded.error().message);
    return result.error();
  };
  pipeline::Case wrong = case_;
  EXPECT_TRUE(write_file(wrong.views[1].image, image::encode_png(image::Image<std::uint8_t>(100, 101, 9))));
  EXPECT_EQ(refused(wrong).message, "LAT: the camera is for 201 x 101 pixels, the image has 100 x 101");
  wrong.views[1].camera = folder_.path() / "none.txt";
  EXPECT_EQ(refused(wrong).reason, Reason::missing_file);
  wrong.views[0].image = folder_.path() / "ap_{frame:03d}.png";
  EXPECT_THAT(refused(wrong).message, HasSubstr("name the frames with --frames"));
}

}  // namespace camera_case_test
}  // namespace helicarm::case_registration
