// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/points.h"

#include <numbers>

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

geometry::RigidTransform motion(double x, double y, double z, double degrees, const Eigen::Vector3d& axis) {
  return {Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix(),
          {x, y, z}};
}

/// A frontal and a lateral view; the femur moves between them.
class TwoViews : public testing::Test {
 protected:
  TwoViews() {
    calibration::CalibratedView frontal;
    frontal.view = {{4000, 4000, 512, 512, 0}, motion(0, 0, 800, 0, {0, 0, 1})};
    calibration::CalibratedView lateral;
    lateral.view = {{4000, 4000, 512, 512, 0}, motion(0, 0, 800, 90, {0, 1, 0})};
    calibration.views = {frontal, lateral};
    calibration.joint_covariance = 1e-12 * Eigen::MatrixXd::Identity(22, 22);
    const geometry::RigidTransform tracker_from_calibrator = motion(-80, -100, 750, 40, {1, 2, 3});
    const geometry::RigidTransform tracker_from_femur = motion(-40, -140, 770, 120, {3, -1, 1});
    the_case.views.resize(2);
    the_case.views[0].poses = {tracker_from_calibrator, {{"femur", tracker_from_femur}}, {}};
    the_case.views[1].poses = {
        tracker_from_calibrator, {{"femur", tracker_from_femur * motion(2, 3, -1, 8, {1, 0, 0})}}, {}};
  }

  Eigen::Vector3d in_calibrator(std::size_t view) const {
    return *guidance::calibrator_from("femur", the_case.views[view].poses) * point_in_femur;
  }

  PointResult image_point(std::optional<guidance::Bone> moves_with) const {
    PointResult point{"FS", localization::PointSource::pick, moves_with, {}, {}, 0, {}};
    for (std::size_t i = 0; i < 2; ++i) {
      const Eigen::Vector2d uv = calibration.views[i].view.project(in_calibrator(i));
      point.seen.emplace_back(fiducials::ImagePoint{uv, uv, 0.1});
    }
    return point;
  }

  calibration::Calibration calibration;
  Case the_case;
  Eigen::Vector3d point_in_femur{12, -7, 30};
};

TEST_F(TwoViews, RaysMeetInTheFrameOfTheBoneThatMoved) {
  std::vector<PointResult> points = {image_point("femur")};
  EXPECT_TRUE(locate_points(the_case, calibration, points).empty());
  ASSERT_TRUE(points[0].place);
  EXPECT_LT((points[0].place->in("femur")->point() - point_in_femur).norm(), 1e-6);
  EXPECT_LT((points[0].place->in_calibrator - in_calibrator(0)).norm(), 1e-6);
  EXPECT_LT(points[0].ray_gap_mm, 1e-6);
}

TEST_F(TwoViews, RaysThatMissInflateTheCovariance) {
  std::vector<PointResult> points = {image_point(std::nullopt)};
  const auto warnings = locate_points(the_case, calibration, points);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::residual_too_large);
  EXPECT_GT(points[0].place->covariance_in_calibrator.trace(), 0.1);
}

TEST_F(TwoViews, TrackerNoiseExplainsARayGap) {
  // The second view's pose of the femur is 0.7 mm wrong: far more than the pixels explain.
  the_case.views[1].poses.tracker_from_bone.at("femur").translation += Eigen::Vector3d(0.4, 0.4, 0.4);
  PointResult seen = image_point("femur");
  the_case.views[1].poses.tracker_from_bone.at("femur").translation -= Eigen::Vector3d(0.4, 0.4, 0.4);
  std::vector<PointResult> points = {seen};
  EXPECT_EQ(locate_points(the_case, calibration, points).size(), 1u);
  the_case.tracker.sigma_mm = 0.4;
  points = {seen};
  EXPECT_TRUE(locate_points(the_case, calibration, points).empty());
  the_case.tracker.samples =
      guidance::Samples::shared;  // one sample for both: its noise does not explain the ray gap
  points = {seen};
  EXPECT_EQ(locate_points(the_case, calibration, points).size(), 1u);
}

TEST_F(TwoViews, BoneWithoutPosesIsTakenAsFixed) {
  the_case.views[1].poses = the_case.views[0].poses;
  std::vector<PointResult> points = {image_point("femur")};
  the_case.views[1].poses = {};
  const auto warnings = locate_points(the_case, calibration, points);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::bone_taken_as_fixed);
  EXPECT_TRUE(points[0].place);
}

TEST_F(TwoViews, UntrackedPointHasANoteOfUnobservableMotion) {
  the_case.views[1].poses = the_case.views[0].poses;
  std::vector<PointResult> points = {image_point("femur"), image_point(std::nullopt)};
  points[1].name = "bare";
  locate_points(the_case, calibration, points);
  const auto notes = note_motion(the_case, calibration, points, 0);
  ASSERT_EQ(notes.size(), 1u);  // the tracked bone's poses state its motion
  EXPECT_EQ(notes[0].reason, Reason::unobservable_motion);
  EXPECT_TRUE(points[0].notes.empty());
  ASSERT_EQ(points[1].notes.size(), 1u);
  // The first view looks along z.
  EXPECT_GT(notes[0].figures.at("direction_z"), 0.99);
  EXPECT_EQ(notes[0].figures.at("mm_per_mm"), 1);
}

TEST_F(TwoViews, MotionSigmaIsForUntrackedPointsOnly) {
  the_case.views[1].poses = the_case.views[0].poses;
  const auto variance = [&](std::optional<guidance::Bone> moves_with, double sigma) {
    std::vector<PointResult> points = {image_point(moves_with)};
    locate_points(the_case, calibration, points, sigma);
    return points[0].place->covariance_in_calibrator.trace();
  };
  EXPECT_EQ(variance("femur", 2), variance("femur", 0));
  EXPECT_GT(variance(std::nullopt, 2), 3.9);
}

TEST_F(TwoViews, WarningsAreAlsoInThePoint) {
  std::vector<PointResult> points = {image_point(std::nullopt)};
  locate_points(the_case, calibration, points);
  ASSERT_EQ(points[0].warnings.size(), 1u);
  EXPECT_EQ(points[0].warnings[0].reason, Reason::residual_too_large);
  EXPECT_TRUE(points[0].rays_miss);
}

TEST_F(TwoViews, PickOnAFiducialInAllViewsIsNotLocated) {
  the_case.views[1].poses = the_case.views[0].poses;
  const Eigen::Vector3d place = in_calibrator(0);
  the_case.calibrator.balls = {{"P1", place + Eigen::Vector3d(40, 0, 0), 4}, {"P2", place, 4}};
  std::vector<PointResult> points = {image_point(std::nullopt)};
  locate_points(the_case, calibration, points);
  const auto warnings = picks_on_fiducials(the_case, calibration, points);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::pick_on_fiducial);
  EXPECT_NE(warnings[0].message.find("P2"), std::string::npos);
  EXPECT_FALSE(points[0].place);
  ASSERT_TRUE(points[0].reason);
  EXPECT_EQ(points[0].reason->reason, Reason::pick_on_fiducial);
}

TEST_F(TwoViews, PickOnAFiducialsImageInOneViewIsAllowed) {
  the_case.views[1].poses = the_case.views[0].poses;
  const Eigen::Vector3d place = in_calibrator(0);
  const Eigen::Vector3d source = calibration.views[1].view.camera_from_world.inverse().translation;
  the_case.calibrator.balls = {{"P1", place + 30 * (source - place).normalized(), 4}};
  std::vector<PointResult> points = {image_point(std::nullopt)};
  locate_points(the_case, calibration, points);
  EXPECT_TRUE(picks_on_fiducials(the_case, calibration, points).empty());
  EXPECT_TRUE(points[0].place);
}

TEST_F(TwoViews, PointObservedOnceIsNotLocated) {
  std::vector<PointResult> points = {image_point("femur")};
  points[0].seen[1].reset();
  locate_points(the_case, calibration, points);
  EXPECT_FALSE(points[0].place);
  ASSERT_TRUE(points[0].reason);
  EXPECT_EQ(points[0].reason->reason, Reason::not_seen);
}

}  // namespace
}  // namespace helicarm::pipeline
