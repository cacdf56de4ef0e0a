// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/guide.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::guidance {
namespace {

geometry::RigidTransform motion(double x, double y, double z, double degrees, const Eigen::Vector3d& axis) {
  return {Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix(),
          {x, y, z}};
}

const geometry::RigidTransform tracker_from_calibrator = motion(-80, -100, 750, 40, {1, 2, 3});
const geometry::RigidTransform tracker_from_femur = motion(-40, -140, 770, 120, {3, -1, 1});
const geometry::RigidTransform tracker_from_tibia = motion(-120, -20, 740, 75, {0, 1, 1});
const geometry::RigidTransform tracker_from_tool = motion(110, -190, 1100, 200, {1, 1, 0});

Poses all_poses() {
  return {tracker_from_calibrator,
          {{"femur", tracker_from_femur}, {"tibia", tracker_from_tibia}},
          tracker_from_tool};
}

geometry::View frontal() { return {{4000, 4000, 512, 512, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 800}}}; }
geometry::View lateral() { return {{4000, 4000, 512, 512, 0}, motion(0, 0, 800, 90, {0, 1, 0})}; }

struct PointInViews : localization::LocatedPoint {
  PointInViews(const Eigen::Vector3d& point, const Eigen::Matrix3d& covariance, std::optional<Bone> bone,
               std::vector<DatedView> dated_views)
      : anchor(bone), dated(std::move(dated_views)) {
    point_in_anchor = point;
    covariance_in_anchor = covariance;
  }

  std::optional<Bone> anchor;
  std::vector<DatedView> dated;
};

PointInFrames guide(const PointInViews& point, const Poses& now, const TrackerNoise& noise) {
  return guide(point, point.anchor, point.dated, now, noise);
}

PointInViews femoral_point(const Poses& first, const Poses& second) {
  const geometry::RigidTransform calibrator_from_femur = *calibrator_from("femur", first);
  return {calibrator_from_femur.inverse() * Eigen::Vector3d(10, -5, 20),
          0.01 * Eigen::Matrix3d::Identity(),
          "femur",
          {{frontal(), first, 1}, {lateral(), second, 1}}};
}

TEST(Guide, PointFollowsAMovedFemurToTheTool) {
  const geometry::RigidTransform bend = motion(3, -2, 5, 12, {1, 0, 0});
  Poses now = all_poses();
  now.tracker_from_bone["femur"] = tracker_from_femur * bend;
  const PointInViews point = femoral_point(all_poses(), all_poses());

  const PointInFrames guided = guide(point, now, {});

  EXPECT_TRUE(guided.in_calibrator.isApprox(Eigen::Vector3d(10, -5, 20), 1e-12));
  EXPECT_TRUE(guided.in("femur")->point().isApprox(point.point_in_anchor, 1e-12));
  const Eigen::Vector3d expected =
      tracker_from_tool.inverse() * (tracker_from_femur * bend * point.point_in_anchor);
  EXPECT_TRUE(guided.in_tool->point().isApprox(expected, 1e-12));
}

TEST(Guide, PointWithoutABoneIsFixedInTheTracker) {
  const PointInViews point{{10, -5, 20}, Eigen::Matrix3d::Zero(), {}, {{frontal(), all_poses(), 1}}};
  Poses now = all_poses();
  now.tracker_from_bone["femur"] = motion(0, 0, 0, 90, {0, 0, 1});
  const PointInFrames guided = guide(point, now, {});
  const Eigen::Vector3d expected =
      tracker_from_tool.inverse() * (tracker_from_calibrator * Eigen::Vector3d(10, -5, 20));
  EXPECT_TRUE(guided.in_tool->point().isApprox(expected, 1e-12));
}

TEST(Guide, MissingReadingsLeavePositionsAbsent) {
  const PointInViews point{{1, 2, 3}, Eigen::Matrix3d::Identity(), {}, {{frontal(), {}, 1}}};
  const PointInFrames guided = guide(point, all_poses(), {});
  EXPECT_TRUE(guided.in_bones.empty());
  EXPECT_FALSE(guided.in_tool);
  EXPECT_EQ(guided.in_calibrator, Eigen::Vector3d(1, 2, 3));
}

TEST(Guide, WithoutNoiseTheCovarianceIsOnlyRotated) {
  Poses poses = all_poses();
  PointInViews point = femoral_point(poses, poses);
  point.covariance_in_anchor = Eigen::Vector3d(1, 4, 9).asDiagonal();
  const PointInFrames guided = guide(point, poses, {});
  EXPECT_NEAR(guided.in_tool->covariance.trace(), 14, 1e-9);
  EXPECT_NEAR(guided.in_tool->covariance.determinant(), 36, 1e-9);
}

TEST(Guide, SharedReadingOfABoneCancelsInTheTool) {
  const Poses poses = all_poses();
  PointInViews point = femoral_point(poses, poses);
  point.covariance_in_anchor.setZero();
  const double only_shift = guide(point, poses, {0.1, 0, Samples::shared}).in_tool->covariance.trace();
  EXPECT_NEAR(only_shift, 3 * 2 * 0.01, 1e-9);  // calibrator and tool remain
  const double own_readings = guide(point, poses, {0.1, 0, Samples::independent}).in_tool->covariance.trace();
  EXPECT_GT(own_readings, only_shift);
  EXPECT_NEAR(guide(point, poses, {0.1, 0.05, Samples::shared}).covariance_in_calibrator.trace(), 0, 1e-12);
}

TEST(Guide, PointInTheBoneReachesTheToolWithTheSameErrors) {
  const TrackerNoise noise{0.12, 0.05, Samples::independent};
  const Poses poses = all_poses();
  const PointInFrames guided = guide(femoral_point(poses, poses), poses, noise);
  const PropagatedPoint in_tool =
      to_tool(guided.in("femur")->propagated, "femur", tracker_from_femur, tracker_from_tool);
  EXPECT_TRUE(in_tool.point.isApprox(guided.in_tool->point(), 1e-12));
  EXPECT_TRUE(in_tool.total_covariance(noise).isApprox(guided.in_tool->covariance, 1e-9));
}

TEST(Guide, PointHalfWayBetweenTwoHasTheErrorsThatTheirDifferenceLacks) {
  const TrackerNoise noise{0.12, 0.05, Samples::independent};
  const Poses poses = all_poses();
  PointInViews one = femoral_point(poses, poses), other = one;
  other.point_in_anchor += Eigen::Vector3d(5, 30, -10);
  const Eigen::MatrixXd calibration = Eigen::Vector2d(0.04, 0.09).asDiagonal();
  one.by_calibration = (Eigen::MatrixXd(3, 2) << 0.5, -1, 2, 0.3, -0.7, 1.1).finished();
  other.by_calibration = (Eigen::MatrixXd(3, 2) << 0.2, 1, -1.5, 0.4, 0.9, -0.6).finished();
  for (PointInViews* point : {&one, &other})
    point->covariance_in_anchor += point->by_calibration * calibration * point->by_calibration.transpose();
  const PropagatedPoint from = guide(one, poses, noise).in("femur")->propagated;
  const PropagatedPoint to = guide(other, poses, noise).in("femur")->propagated;
  const Eigen::Matrix3d half = point_between(from, to, 0.5, calibration).total_covariance(noise);
  const Eigen::Matrix3d difference = covariance_between(from, to, calibration, noise);
  EXPECT_TRUE((4 * half + difference)
                  .isApprox(2 * (from.total_covariance(noise) + to.total_covariance(noise)), 1e-9));
}

/// Draws one noisy reading from the covariance's noise model.
geometry::RigidTransform noisy(const geometry::RigidTransform& pose, const TrackerNoise& noise,
                               RandomStream& stream) {
  const double rad = noise.sigma_deg * std::numbers::pi / 180;
  const Eigen::Vector3d shift{stream.normal(), stream.normal(), stream.normal()};
  const Eigen::Vector3d turn = rad * Eigen::Vector3d{stream.normal(), stream.normal(), stream.normal()};
  return pose * geometry::RigidTransform{Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix(),
                                         noise.sigma_mm * shift};
}

/// Point nearest to two rays, in a bone's frame.
Eigen::Vector3d meet(const std::vector<DatedView>& views,
                     const std::vector<Eigen::Vector3d>& true_in_calibrator) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const geometry::RigidTransform femur_from_calibrator =
        calibrator_from("femur", views[i].poses)->inverse();
    const Eigen::Vector3d source = femur_from_calibrator * views[i].view.source_in_world();
    const Eigen::Vector3d through = femur_from_calibrator * true_in_calibrator[i];
    const Eigen::Vector3d ray = (through - source).normalized();
    const Eigen::Matrix3d across =
        (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / (through - source).squaredNorm();
    sum += across;
    right += across * source;
  }
  return sum.ldlt().solve(right);
}

TEST(Guide, CovarianceAgreesWithMonteCarloReadings) {
  const TrackerNoise noise{0.12, 0.05, Samples::independent};
  const Poses first = all_poses();
  Poses second = all_poses();
  second.tracker_from_bone["femur"] = tracker_from_femur * motion(2, 1, -1, 5, {0, 1, 0});
  PointInViews point = femoral_point(first, second);
  point.covariance_in_anchor.setZero();
  const std::vector<Eigen::Vector3d> seen = {*calibrator_from("femur", first) * point.point_in_anchor,
                                             *calibrator_from("femur", second) * point.point_in_anchor};
  const PointInFrames guided = guide(point, first, noise);

  constexpr int trials = 20000;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream stream(7, 1, static_cast<std::uint64_t>(trial));
    std::vector<DatedView> drawn = point.dated;
    for (DatedView& view : drawn) {
      view.poses.tracker_from_calibrator = noisy(*view.poses.tracker_from_calibrator, noise, stream);
      auto& tracker_from_bone = view.poses.tracker_from_bone.at("femur");
      tracker_from_bone = noisy(tracker_from_bone, noise, stream);
    }
    const Eigen::Vector3d in_tracker = noisy(tracker_from_femur, noise, stream) * meet(drawn, seen);
    const Eigen::Vector3d error =
        noisy(tracker_from_tool, noise, stream).inverse() * in_tracker - guided.in_tool->point();
    spread += error * error.transpose() / trials;
  }
  EXPECT_LT((spread - guided.in_tool->covariance).norm(), 0.05 * spread.norm());
}

}  // namespace
}  // namespace helicarm::guidance
