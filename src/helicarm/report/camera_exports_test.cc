// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/camera_exports.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::report {
namespace {
namespace fs = std::filesystem;

class CameraExports : public testing::TestWithParam<double> {
 protected:
  CameraExports() {
    view_.name = "AP";
    view_.xray_image = std::make_shared<const xray::XrayImage>(
        xray::XrayImage{"AP", image::Image<float>(64, 48), 0, 4095, {}, {}});
    view_.rectification.emplace();
    view_.rectification->map = rectification::identity_map(64, 48, 0.25);
    view_.calibrated = calibration::CalibratedView{};
    view_.calibrated->view = {{GetParam(), 4000.25, 511.1, 490.7, 0},
                              {geometry::rotation_from_vector({0.2, -1.4, 0.6}), {3, -5, 801.0 / 3}}};
  }
  ~CameraExports() override { fs::remove(path_); }

  const fs::path& written(const std::string& text) const {
    EXPECT_TRUE(write_file(path_, text));
    return path_;
  }
  void expect_pixels(const geometry::View& view, bool rows_upwards) const {
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), {10, 20, 30}, {-25, 4, -12}}) {
      Eigen::Vector2d pixel = view.project(point);
      if (rows_upwards) pixel.y() = 47 - pixel.y();
      EXPECT_LT((pixel - view_.calibrated->view.project(point)).norm(), 1e-7);
    }
  }

  pipeline::ViewResult view_;
  const fs::path path_ = fs::temp_directory_path() / fmt::format("helicarm_camera_exports_{}", ::getpid());
};

TEST_P(CameraExports, OpenCvReadsItsOwnFormat) {
  const cv::FileStorage file(opencv_yaml(view_), cv::FileStorage::READ | cv::FileStorage::MEMORY);
  ASSERT_TRUE(file.isOpened());
  EXPECT_EQ(int(file["image_width"]), 64);
  EXPECT_EQ(int(file["image_height"]), 48);
  const cv::Mat k = file["camera_matrix"].mat(), lens = file["distortion_coefficients"].mat();
  const cv::Mat r = file["R"].mat(), t = file["tvec"].mat(), rvec = file["rvec"].mat();
  const geometry::View& view = view_.calibrated->view;
  EXPECT_EQ(k.at<double>(0, 0), GetParam());
  EXPECT_EQ(k.at<double>(1, 2), 490.7);
  EXPECT_EQ(cv::countNonZero(lens), 0);
  EXPECT_EQ(lens.total(), 5u);
  EXPECT_EQ(r.at<double>(2, 1), view.camera_from_world.rotation(2, 1));
  EXPECT_EQ(t.at<double>(2, 0), 801.0 / 3);
  EXPECT_NEAR(rvec.at<double>(1, 0), -1.4, 1e-12);
}

TEST_P(CameraExports, OpenCvFileIsImported) {
  const auto back = exchange::import_matrix(written(opencv_yaml(view_)));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->view.projection(), view_.calibrated->view.projection());
  EXPECT_EQ(back->image_size, Eigen::Vector2i(64, 48));
}

TEST_P(CameraExports, RtkGeometryShowsPointsAtTheirPixels) {
  const std::string text = rtk_geometry(view_);
  const bool mirrored = GetParam() < 0;
  EXPECT_THAT(text,
              testing::HasSubstr(fmt::format("spacing {} 0.25 mm", 4000.25 * 0.25 / std::abs(GetParam()))));
  EXPECT_EQ(text.find("rows run upwards") == text.npos, mirrored);
  exchange::ImportOptions options{.image_size = Eigen::Vector2i(64, 48)};
  options.pixel_mm = {4000.25 * 0.25 / std::abs(GetParam()), 0.25};
  const auto back = exchange::import_matrix(written(text), options);
  ASSERT_TRUE(back) << back.error().message;
  expect_pixels(back->view, false);  // the comment states the rows' direction
}

TEST_P(CameraExports, PoseIsAnItkTransform) {
  const auto back = exchange::read_itk_transform(written(itk_pose(view_)));
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_TRUE(*back);
  const geometry::RigidTransform& pose = view_.calibrated->view.camera_from_world;
  EXPECT_LT(((*back)->matrix() - pose.matrix()).norm(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Handedness, CameraExports, testing::Values(4000.5, -4100.75));

}  // namespace
}  // namespace helicarm::report
