// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/camera_files.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::calibration {
namespace {

/// A file of each kind, all of one camera.
class CameraFiles : public testing::Test {
 protected:
  CameraFiles() {
    view_.intrinsics = {5000, 5000, 512, 500, 0};
    view_.camera_from_world.translation = {3, -4, 700};
    SavedCalibration saved;
    saved.views = {{.name = "AP", .view = view_, .dlt = {}}, {.name = "LAT", .view = view_, .dlt = {}}};
    saved.maps.resize(2);
    write("two.json", to_json(saved));
    saved.joint_covariance = Eigen::MatrixXd::Identity(22, 22);
    saved.joint_covariance(0, 11) = saved.joint_covariance(11, 0) = 0.5;
    write("joint.json", to_json(saved));
    const Json projection = geometry::json_rows(view_.projection());
    write("import.json", {{"K", geometry::json_rows(view_.intrinsics.matrix())},
                          {"R", geometry::json_rows(view_.camera_from_world.rotation)},
                          {"t", geometry::json_list(view_.camera_from_world.translation)},
                          {"projection", projection},
                          {"image_size", nullptr}});
    write("matrix.json", {{"projection", projection}});
    write("solve.json", {{"dlt", nullptr},
                         {"projection", projection},
                         {"camera_from_world", geometry::json_rows(view_.camera_from_world.matrix())},
                         {"covariance", geometry::json_rows(Eigen::MatrixXd::Identity(11, 11) * 4)},
                         {"reprojection_rms_px", 0.25}});
  }

  void write(const char* name, const Json& json) {
    EXPECT_TRUE(write_file(folder_.path() / name, to_text(json)));
  }

  Expected<SavedCalibration> read(std::initializer_list<std::pair<const char*, const char*>> files) {
    std::vector<CameraFile> all;
    for (const auto& [view, name] : files) all.push_back({view, folder_.path() / name});
    return calibration_of_cameras(all);
  }

  TemporaryFolder folder_;
  geometry::View view_;
};

TEST_F(CameraFiles, OfEveryKindGiveTheCamera) {
  const auto cameras =
      read({{"A", "import.json"}, {"B", "solve.json"}, {"LAT", "two.json"}, {"M", "matrix.json"}});
  ASSERT_TRUE(cameras) << cameras.error().message;
  for (const CalibratedView& view : cameras->views)
    EXPECT_LT((view.view.project({10, 20, 30}) - view_.project({10, 20, 30})).norm(), 1e-8) << view.name;
  EXPECT_EQ(cameras->joint_covariance.diagonal().sum(), 44);
  EXPECT_TRUE(cameras->views[0].covariance.isZero(0));
  EXPECT_FALSE(cameras->views[1].covariance.isZero(0));
}

TEST_F(CameraFiles, KeepTheCovarianceAmongTheViewsOfOneFile) {
  const auto cameras = read({{"LAT", "joint.json"}, {"B", "solve.json"}, {"AP", "joint.json"}});
  ASSERT_TRUE(cameras) << cameras.error().message;
  ASSERT_EQ(cameras->joint_covariance.rows(), 33);
  EXPECT_EQ(cameras->joint_covariance(0, 22), 0.5);
  EXPECT_EQ(cameras->joint_covariance(11, 11), 4);
  EXPECT_EQ(cameras->joint_covariance(0, 11), 0);
}

TEST_F(CameraFiles, OneFileByTwoSpellingsIsOne) {
  const auto cameras = read({{"AP", "joint.json"}, {"LAT", "./joint.json"}});
  ASSERT_TRUE(cameras) << cameras.error().message;
  EXPECT_EQ(cameras->joint_covariance(0, 11), 0.5);
}

TEST_F(CameraFiles, WithoutTheViewNameThoseTheyHave) {
  const auto cameras = read({{"OBL", "two.json"}});
  ASSERT_FALSE(cameras);
  EXPECT_EQ(cameras.error().reason, Reason::bad_value);
  EXPECT_NE(cameras.error().message.find("AP, LAT"), std::string::npos);
}

TEST_F(CameraFiles, TwoOfOneViewAreRefused) {
  EXPECT_EQ(read({{"A", "import.json"}, {"A", "solve.json"}}).error().reason, Reason::name_clash);
}

TEST_F(CameraFiles, MissingFileIsMissing) {
  EXPECT_EQ(read({{"A", "none.json"}}).error().reason, Reason::missing_file);
}

TEST(CameraFile, NeedsAView) {
  EXPECT_EQ(camera_file_from("cam.json").error().reason, Reason::usage);
  EXPECT_EQ(camera_file_from("AP=cam.json")->view, "AP");
}

}  // namespace
}  // namespace helicarm::calibration
