// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/track_case.h"

#include <gmock/gmock.h>

#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/image/png.h"
#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace track_case_test {

using testing::HasSubstr;

const Eigen::Vector2i size{500, 480};

calibration::SavedCalibration calibrated(double sigma = 0) {
  calibration::SavedCalibration saved;
  for (const geometry::View& camera : two_cameras()) {
    calibration::CalibratedView& view = saved.views.emplace_back();
    view.name = saved.views.size() == 1 ? "A" : "B";
    view.view = camera;
    saved.maps.emplace_back(rectification::identity_map(size.x(), size.y(), {}));
  }
  if (sigma > 0) saved.joint_covariance = Eigen::MatrixXd::Constant(22, 22, sigma * sigma);
  return saved;
}

/// A folder with two views, whose cameras come from a calibration or, with a map, from files without a size.
class TrackCaseFile : public testing::Test {
 protected:
  TrackCaseFile() {
    write("x.json", calibration::to_json(calibrated()));
    write("map.json", rectification::to_json(*calibrated().maps[0]));
    for (const calibration::CalibratedView& view : calibrated().views)
      write(view.name + ".json", {{"projection", geometry::json_rows(view.view.projection())}});
    EXPECT_TRUE(write_file(folder_.path() / "points.csv",
                           "a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\n250,229,250,229\n250,229,250,229\n"));
  }

  Json by_calibration() const {
    return {{"format", "helicarm-case/2"},
            {"calibration", "x.json"},
            {"markers", {{"diameter_mm", 2}}},
            {"views",
             {{{"name", "A"}, {"image", "a_{frame}.png"}}, {{"name", "B"}, {"image", "b_{frame}.png"}}}}};
  }
  Json by_cameras() const {
    Json json = by_calibration();
    json.erase("calibration");
    for (Json& view : json["views"]) {
      view["camera"] = view["name"].get<std::string>() + ".json";
      view["map"] = "map.json";
    }
    return json;
  }

  void write(const std::string& name, const Json& json) {
    EXPECT_TRUE(write_file(folder_.path() / name, json.dump()));
  }
  Expected<TrackCase> read(const Json& json, const case_registration::FrameRange& frames, bool with_points) {
    write("case.json", json);
    PointsFile points{folder_.path() / "points.csv"};
    points.of_all_frames = points.y_up = true;
    return read_track_case(folder_.path(), frames, with_points ? std::optional(points) : std::nullopt);
  }

  TemporaryFolder folder_;
};

TEST_F(TrackCaseFile, MapStatesTheSizeOfItsImages) {
  for (const Json& json : {by_calibration(), by_cameras()}) {
    const auto the_case = read(json, {1, 2, 1}, true);
    ASSERT_TRUE(the_case) << the_case.error().message;
    for (const TrackView& view : the_case->views) EXPECT_EQ(view.image_size, size);
    EXPECT_EQ((*the_case->points[0][0]).y(), size.y() - 1 - 229);
  }
}

TEST_F(TrackCaseFile, ImagesOfAnotherSizeThanTheMapsAreRefused) {
  const std::string png = image::encode_png(image::Image<std::uint8_t>(640, 480));
  for (const char* name : {"a_1.png", "b_1.png"}) EXPECT_TRUE(write_file(folder_.path() / name, png));
  for (const Json& json : {by_calibration(), by_cameras()}) {
    const auto the_case = read(json, {1, 1, 1}, true);
    ASSERT_TRUE(the_case) << the_case.error().message;
    const auto images = SequenceImages::open(
        std::vector<SequenceView>(the_case->views.begin(), the_case->views.end()), {1, 1, 1});
    ASSERT_FALSE(images);
    EXPECT_EQ(images.error().reason, Reason::bad_size);
    EXPECT_THAT(images.error().message,
                HasSubstr("640 x 480 pixels, the camera, its map or the first image 500"));
  }
}

TEST_F(TrackCaseFile, MapOfAnotherSizeThanTheCameraIsRefused) {
  Json camera = *read_json(folder_.path() / "B.json");
  camera["image_size"] = {640, 480};
  write("B.json", camera);
  const auto the_case = read(by_cameras(), {1, 1, 1}, true);
  ASSERT_FALSE(the_case);
  EXPECT_EQ(the_case.error().reason, Reason::bad_size);
  EXPECT_THAT(the_case.error().message, HasSubstr("views[1]: \"map\" is for images of 500 x 480"));
}

TEST_F(TrackCaseFile, ErrorsOfViewsThatWereCalibratedApartAreIndependent) {
  write("x.json", calibration::to_json(calibrated(0.1)));
  write("y.json", calibration::to_json(calibrated(0.2)));
  Json json = by_calibration();
  auto the_case = read(json, {1, 1, 1}, true);
  ASSERT_TRUE(the_case) << the_case.error().message;
  EXPECT_TRUE(the_case->camera_covariance.isApproxToConstant(0.01));
  json["views"][1]["calibration"] = "y.json";
  the_case = read(json, {1, 1, 1}, true);
  ASSERT_TRUE(the_case) << the_case.error().message;
  const Eigen::MatrixXd& covariance = the_case->camera_covariance;
  EXPECT_TRUE(covariance.topLeftCorner(11, 11).isApproxToConstant(0.01));
  EXPECT_TRUE(covariance.bottomRightCorner(11, 11).isApproxToConstant(0.04));
  EXPECT_TRUE(covariance.topRightCorner(11, 11).isZero(0));
  EXPECT_TRUE(covariance.bottomLeftCorner(11, 11).isZero(0));
}

TEST_F(TrackCaseFile, CorrectionOfAFrameThatTheStepLeavesOutIsRefused) {
  Json json = by_calibration();
  for (const int frame : {1, 8})
    for (const char* view : {"A", "B"})
      json["picks"].push_back({{"name", "a"}, {"view", view}, {"frame", frame}, {"uv", {250, 250}}});
  EXPECT_TRUE(read(json, {1, 8, 1}, false));
  EXPECT_TRUE(read(json, {1, 7, 2}, false));  // it is behind the last
  const auto refused = read(json, {1, 8, 2}, false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_THAT(refused.error().message, HasSubstr("\"a\" of frame 8: is not among the frames, every 2th"));
}

}  // namespace track_case_test
}  // namespace helicarm::track
