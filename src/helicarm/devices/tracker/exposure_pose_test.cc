// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/exposure_pose.h"

#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/devices/tracker/pose_buffer.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace exposure_pose_test {

const geometry::RigidTransform truth{geometry::rotation_from_vector({1, -0.4, 0.7}), {120, 40, 800}};

Eigen::Vector3d noise(RandomStream& random, double sigma) {
  return sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

/// 40 poses per second from 9 s to 11 s.
std::vector<PoseSample> at_rest(std::uint64_t trial = 0, double sigma_mm = 0.1, double sigma_rad = 0.001) {
  RandomStream random(21, 0, trial);
  std::vector<PoseSample> samples;
  for (int i = 0; i <= 80; ++i) {
    const double time = 9 + i / 40.0;
    samples.push_back({time,
                       0,
                       time,
                       {geometry::rotation_from_vector(noise(random, sigma_rad)) * truth.rotation,
                        truth.translation + noise(random, sigma_mm)}});
  }
  return samples;
}

Reason reason_of(const std::vector<PoseSample>& samples, double time_s = 10) {
  const auto pose = exposure_pose(samples, time_s);
  EXPECT_FALSE(pose);
  return pose ? Reason::usage : pose.error().reason;
}

TEST(ExposurePose, MeanIsMoreAccurateThanASample) {
  const auto pose = exposure_pose(at_rest(), 10);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->samples, 21);
  EXPECT_LT((pose->tracker_from_tool.translation - truth.translation).norm(), 0.1);
  EXPECT_NEAR(pose->spread_mm, 0.1 * std::sqrt(3), 0.04);
}

TEST(ExposurePose, CovarianceAgreesWithTheError) {
  double square_mm = 0, square_rad = 0, said_mm = 0, said_rad = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const auto pose = exposure_pose(at_rest(trial), 10);
    ASSERT_TRUE(pose);
    square_mm += (pose->tracker_from_tool.translation - truth.translation).squaredNorm();
    square_rad +=
        geometry::vector_from_rotation(pose->tracker_from_tool.rotation * truth.rotation.transpose())
            .squaredNorm();
    said_mm += pose->covariance.topLeftCorner<3, 3>().trace();
    said_rad += pose->covariance.bottomRightCorner<3, 3>().trace();
  }
  EXPECT_NEAR(square_mm / said_mm, 1, 0.12);
  EXPECT_NEAR(square_rad / said_rad, 1, 0.12);
}

TEST(ExposurePose, OutliersHaveNoEffect) {
  auto samples = at_rest();
  for (const std::size_t i : {38u, 42u}) {
    samples[i].tracker_from_tool.translation.x() += 50;
    samples[i].tracker_from_tool.rotation =
        geometry::rotation_from_vector({0, 1, 0}) * samples[i].tracker_from_tool.rotation;
  }
  const auto pose = exposure_pose(samples, 10);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->outliers, 2);
  EXPECT_LT((pose->tracker_from_tool.translation - truth.translation).norm(), 0.1);
}

TEST(ExposurePose, NothingIsExtrapolated) {
  EXPECT_EQ(reason_of({}), Reason::no_pose);
  EXPECT_EQ(reason_of(at_rest(), 11.02), Reason::stale_pose);
  EXPECT_EQ(reason_of(at_rest(), 8.98), Reason::stale_pose);
  EXPECT_EQ(reason_of(at_rest(), 60), Reason::stale_pose);
}

TEST(ExposurePose, GapAroundTheTimeIsRefused) {
  auto samples = at_rest();
  std::erase_if(samples, [](const PoseSample& s) { return s.time_s > 9.85 && s.time_s < 10.15; });
  EXPECT_EQ(reason_of(samples), Reason::stale_pose);
  std::erase_if(samples, [](const PoseSample& s) { return s.time_s > 10; });
  EXPECT_EQ(reason_of(samples), Reason::stale_pose);
}

TEST(ExposurePose, TooFewPosesAreRefused) {
  auto samples = at_rest();
  std::erase_if(samples,
                [](const PoseSample& s) { return std::abs(s.time_s - 10) > 0.03 || s.time_s == 10; });
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(reason_of(samples), Reason::stale_pose);
}

TEST(ExposurePose, MotionIsRefused) {
  auto samples = at_rest();
  for (PoseSample& s : samples) s.tracker_from_tool.translation.y() += 10 * s.time_s;
  const auto pose = exposure_pose(samples, 10);
  ASSERT_FALSE(pose);
  EXPECT_EQ(pose.error().reason, Reason::pose_spread);
  EXPECT_GT(pose.error().figures.at("spread_mm"), 1);
}

TEST(ExposurePose, JitterOverTheLimitIsRefused) {
  EXPECT_EQ(reason_of(at_rest(0, 0.5)), Reason::pose_spread);
  EXPECT_EQ(reason_of(at_rest(0, 0.1, 0.02)), Reason::pose_spread);
}

TEST(ExposurePose, TwoAlternatingPositionsAreRefused) {
  auto samples = at_rest();
  for (std::size_t i = 0; i < samples.size(); i += 2) samples[i].tracker_from_tool.translation.z() += 5;
  EXPECT_EQ(reason_of(samples), Reason::pose_spread);
}

TEST(ExposurePose, IdenticalPosesHaveNoOutliers) {
  auto samples = at_rest(0, 0, 0);
  samples[40].tracker_from_tool.translation.x() += 1e-5;
  const auto pose = exposure_pose(samples, 10);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->outliers, 0);
}

TEST(PoseBuffer, KeepsTheNewestPoses) {
  PoseBuffer buffer(5);
  EXPECT_FALSE(buffer.latest());
  EXPECT_TRUE(buffer.between(0, 100).empty());
  for (int i = 0; i < 13; ++i) buffer.push({static_cast<double>(i), 0, 0, {}});
  EXPECT_EQ(buffer.latest()->time_s, 12);
  EXPECT_EQ(buffer.between(0, 100).front().time_s, 8);
  EXPECT_EQ(buffer.between(9, 11).size(), 3u);
  EXPECT_TRUE(buffer.between(13, 14).empty());
  EXPECT_THROW(buffer.push({12, 0, 0, {}}), std::invalid_argument);
}

}  // namespace exposure_pose_test
}  // namespace helicarm::tracker
