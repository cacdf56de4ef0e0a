// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/view_messages.h"

#include <gtest/gtest.h>

#include "helicarm/core/big_endian.h"

namespace helicarm::operation {
namespace view_messages_test {

/// A view with a turned camera 1000 mm from a detector of 0.25 mm a pixel; `fx` may be negative.
pipeline::Result result_of(double fx, const std::string& name) {
  pipeline::Result result;
  pipeline::ViewResult& view = result.views.emplace_back();
  view.name = name;
  view.xray_image = std::make_shared<const xray::XrayImage>(
      xray::XrayImage{name, image::Image<float>(64, 48), 0, 4095, {}, {}});
  view.rectification.emplace();
  view.rectification->map = rectification::identity_map(64, 48, 0.25);
  view.calibrated.emplace();
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 0.2, 0.1).normalized()).matrix();
  view.calibrated->view = {{fx, 4000, 30, 20, 0}, {rotation, {3, -5, 700}}};
  return result;
}

struct Image {
  Eigen::Vector3d column_step, row_step, normal, middle;
};

Image image_in(const tracker::IgtlMessage& message) {
  BigEndianReader in(std::get<tracker::IgtlUnknown>(message.content).content);
  in.take(12);
  Image image;
  for (Eigen::Vector3d* vector : {&image.column_step, &image.row_step, &image.normal, &image.middle})
    for (double& value : *vector) value = in.take<float>();
  return image;
}

void expect_on_rays(const pipeline::Result& result) {
  const auto messages = messages_of_views(result);
  ASSERT_TRUE(messages) << messages.error().message;
  ASSERT_EQ(messages->size(), 2U);
  const Image image = image_in(messages->at(0));
  const geometry::View& view = result.views[0].calibrated->view;
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(63, 0), Eigen::Vector2d(10, 40)}) {
    const Eigen::Vector3d ras =
        image.middle + (pixel.x() - 31.5) * image.column_step + (pixel.y() - 23.5) * image.row_step;
    const Eigen::Vector3d in_calibrator(-ras.x(), -ras.y(), ras.z());
    EXPECT_LT((view.project(in_calibrator) - pixel).norm(), 1e-3);
    EXPECT_NEAR(view.depth(in_calibrator), 1000, 1e-3);
  }
  EXPECT_NEAR(image.row_step.norm(), 0.25, 1e-7);
  EXPECT_NEAR(image.column_step.cross(image.row_step).dot(image.normal), 0.0625, 1e-7);
}

TEST(ViewMessages, APixelLiesWhereItsRayMeetsTheDetector) { expect_on_rays(result_of(4000, "AP")); }

TEST(ViewMessages, AMirroredImageLiesMirrored) { expect_on_rays(result_of(-4000, "LAT")); }

TEST(ViewMessages, TheCameraIsAtTheSource) {
  const pipeline::Result result = result_of(4000, "AP");
  const tracker::IgtlMessage camera = messages_of_views(result)->at(1);
  EXPECT_EQ(camera.device, "AP_camera");
  const Eigen::Matrix4d matrix = std::get<tracker::IgtlTransform>(camera.content).matrix;
  const Eigen::Vector3d source = result.views[0].calibrated->view.camera_from_world.inverse().translation;
  EXPECT_LT((matrix.col(3).head<3>() - Eigen::Vector3d(-source.x(), -source.y(), source.z())).norm(), 1e-9);
  EXPECT_NEAR(matrix.determinant(), 1, 1e-12);
}

TEST(ViewMessages, ALongNameBecomesANumber) {
  const auto messages = messages_of_views(result_of(4000, "lateral of the left knee"));
  EXPECT_EQ(messages->at(0).device, "V1");
  EXPECT_EQ(messages->at(1).device, "V1_camera");
}

TEST(ViewMessages, ARefusedResultHasNone) {
  pipeline::Result result = result_of(4000, "AP");
  result.failure = Failure{Reason::uncertain, "", "", {}};
  EXPECT_EQ(messages_of_views(result).error().reason, Reason::uncertain);
}

}  // namespace view_messages_test
}  // namespace helicarm::operation
