// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/displaced_balls.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

/// Two flat-panel views at a right angle in which no ball is labelled; the file has balls of 3 and 4 mm.
class UnlabelledBalls : public testing::Test {
 protected:
  UnlabelledBalls() {
    for (const double degrees : {0.0, 90.0}) {
      calibration::CalibratedView view;
      const Eigen::Vector3d axis(0, 1, 0);
      view.view = {{4000, 4000, 512, 512, 0},
                   {Eigen::AngleAxisd(degrees * EIGEN_PI / 180, axis).toRotationMatrix(), {0, 0, 800}}};
      calibration.views.push_back(view);
      calibration.fiducials.push_back({{"P3", calibrator.balls[0].centre_in_calibrator},
                                       {"P4", calibrator.balls[1].centre_in_calibrator}});
      LabelledView image;
      image.dots.dark.emplace();
      image.rectification.map = rectification::identity_map(1024, 1024, {});
      images.push_back(image);
    }
  }

  /// A ball in both images, without a label.
  void show(const Eigen::Vector3d& place, double diameter_mm) {
    for (std::size_t i = 0; i < 2; ++i) {
      const geometry::View& view = calibration.views[i].view;
      detection::Dot dot;
      dot.centre_px = view.project(place);
      dot.radius_px = 0.5 * diameter_mm * view.intrinsics.fy / view.depth(place);
      images[i].fiducials.false_blobs.push_back(dot);
    }
  }

  phantom::Calibrator calibrator{"two", {{"P3", {-30, 10, 5}, 3}, {"P4", {20, -15, 0}, 4}}, {}};
  CaseCalibration calibration;
  std::vector<LabelledView> images;
};

TEST_F(UnlabelledBalls, BallsOfEachOthersDiameterLookExchanged) {
  show(calibrator.balls[0].centre_in_calibrator, 4.05);
  show(calibrator.balls[1].centre_in_calibrator, 2.95);
  const auto warnings = displaced_balls(calibration, images, calibrator);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::ball_displaced);
  EXPECT_EQ(warnings[0].message.find("P3 and P4 look exchanged"), 0u) << warnings[0].message;
}

TEST_F(UnlabelledBalls, BallsOfTheirOwnDiameterAreNotExchanged) {
  show(calibrator.balls[0].centre_in_calibrator + Eigen::Vector3d(2, 0, 0), 3);
  show(calibrator.balls[1].centre_in_calibrator, 4);
  for (const Warning& warning : displaced_balls(calibration, images, calibrator))
    EXPECT_EQ(warning.message.find("exchanged"), std::string::npos) << warning.message;
}

TEST_F(UnlabelledBalls, OneBallOfAnotherDiameterIsNoExchange) {
  show(calibrator.balls[0].centre_in_calibrator, 4);
  show(calibrator.balls[1].centre_in_calibrator, 4);
  for (const Warning& warning : displaced_balls(calibration, images, calibrator))
    EXPECT_EQ(warning.message.find("exchanged"), std::string::npos) << warning.message;
}

TEST_F(UnlabelledBalls, BallsThatNoViewShowsAreNamedTogether) {
  const auto warnings = displaced_balls(calibration, images, calibrator);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::not_seen);
  EXPECT_EQ(warnings[0].message.find("fiducials P3, P4 are found in no view"), 0u) << warnings[0].message;
}

TEST_F(UnlabelledBalls, TheOnlyViewNamesAFiducialThatItRejects) {
  calibration.fiducials.resize(1);
  calibration.views.resize(1);
  images.resize(1);
  for (auto& fiducial : calibration.fiducials[0]) fiducial.status = fiducials::FiducialStatus::used;
  fiducials::Fiducial& rejected = calibration.fiducials[0][1];
  rejected.status = fiducials::FiducialStatus::rejected;
  rejected.residual_px = 5;
  const auto warnings = displaced_balls(calibration, images, calibrator);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::ball_displaced);
  EXPECT_EQ(warnings[0].message.find("fiducial P4 lies 5 px, 1 mm"), 0u) << warnings[0].message;
  rejected.residual_px = 0.5;
  EXPECT_TRUE(displaced_balls(calibration, images, calibrator).empty()) << "0.1 mm";
}

TEST_F(UnlabelledBalls, ABallThatOneViewMayHideIsNotMissed) {
  detection::Dot plate_dot;
  plate_dot.centre_px = calibration.views[0].view.project(calibrator.balls[0].centre_in_calibrator);
  plate_dot.radius_px = 8;
  images[0].rectification.plate_dots.push_back(plate_dot);
  calibration.fiducials[1][1].status = fiducials::FiducialStatus::outside;
  EXPECT_TRUE(displaced_balls(calibration, images, calibrator).empty());
}

TEST_F(UnlabelledBalls, OneViewMayShowABallOfWhichACoordinateAlongItsRaysIsWrong) {
  Eigen::Vector3d elsewhere = calibrator.balls[0].centre_in_calibrator;
  elsewhere.z() = -30;
  show(elsewhere, 3);
  for (LabelledView& image : images) image.dots.dark = image.fiducials.false_blobs;
  calibration.fiducials[1][1].status = fiducials::FiducialStatus::outside;
  const auto warnings = displaced_balls(calibration, images, calibrator);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].message.find("fiducial P3 is found in no view"), 0u) << warnings[0].message;
}

TEST_F(UnlabelledBalls, OfASingleViewItsFreePlaceSuffices) {
  images.pop_back();
  calibration.views.pop_back();
  calibration.fiducials.pop_back();
  calibration.fiducials[0][1].status = fiducials::FiducialStatus::occluded;
  const auto warnings = displaced_balls(calibration, images, calibrator);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].message.find("fiducial P3 is found in no view"), 0u) << warnings[0].message;
}

}  // namespace
}  // namespace helicarm::pipeline
