// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/seen_poses.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::operation {
namespace seen_poses_test {

const geometry::RigidTransform at_rest{geometry::rotation_from_euler(0.3, -0.2, 1.1), {100, -50, 900}};

TrackerPlan plan() {
  TrackerPlan plan;
  plan.facets = {{"one", {Eigen::Matrix3d::Identity(), {85, 0, 0}}},
                 {"two", {geometry::rotation_from_euler(0, 0, 1.5), {0, 85, 0}}}};
  plan.sigma_mm = 0.1;
  plan.sigma_deg = 0.02;
  return plan;
}

/// 31 samples about t = 10 s with a little noise.
std::vector<tracker::PoseSample> samples_of(const geometry::RigidTransform& pose, std::uint32_t stream,
                                            const Eigen::Vector3d& drift = Eigen::Vector3d::Zero()) {
  RandomStream random(1, stream);
  std::vector<tracker::PoseSample> samples;
  for (int i = 0; i <= 30; ++i) {
    const double time = 9.25 + 0.05 * i;
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    samples.push_back(
        {time, 0, time, {pose.rotation, pose.translation + 0.05 * noise + drift * (double(i) / 30)}});
  }
  return samples;
}

PoseWindow window() {
  PoseWindow window{10, 0.75, {}};
  window.samples["femur"] = samples_of(at_rest, 1);
  window.samples["tibia"] = {};
  window.samples["tool"] = samples_of(at_rest, 2);
  for (const tracker::Facet& facet : plan().facets)
    window.samples[facet.name] = samples_of(at_rest * facet.calibrator_from_facet, 3);
  return window;
}

TEST(SeenPoses, ToolCovarianceIncludesSystematicError) {
  const SeenPose seen = see_tool(window(), plan(), "femur").value();
  EXPECT_LT((seen.tracker_from_marker.translation - at_rest.translation).norm(), 0.06);
  EXPECT_LT(seen.scatter(0, 0), 0.05 * 0.05 / 10);
  EXPECT_GT(seen.covariance(0, 0), 0.1 * 0.1);
}

TEST(SeenPoses, AMarkerThatVanishesIsNotSeenAtTheEnd) {
  PoseWindow seen = window();
  EXPECT_TRUE(is_seen_at_end(seen, "femur"));
  EXPECT_FALSE(is_seen_at_end(seen, "tibia"));
  EXPECT_FALSE(is_seen_at_end(seen, "unknown"));
  seen.samples["femur"].resize(25);  // the last one 0.3 s before the end
  EXPECT_FALSE(is_seen_at_end(seen, "femur"));
}

TEST(SeenPoses, CalibratorPoseIsFusedFromItsFacets) {
  const SeenPose seen = see_calibrator(window(), plan()).value();
  EXPECT_LT((seen.tracker_from_marker.translation - at_rest.translation).norm(), 0.15);
}

TEST(SeenPoses, OneFacetIsEnough) {
  PoseWindow seen = window();
  seen.samples["two"].clear();
  EXPECT_TRUE(see_calibrator(seen, plan()));
  seen.samples["one"].clear();
  EXPECT_FALSE(see_calibrator(seen, plan()));
}

TEST(SeenPoses, OccludedBoneIsAbsentFromTheAcquisition) {
  const guidance::Poses poses = poses_of_exposure(window(), plan()).value();
  EXPECT_TRUE(poses.tracker_from_calibrator && poses.tracker_from("femur"));
  EXPECT_FALSE(poses.tracker_from("tibia"));
}

TEST(SeenPoses, BoneThatMovedDuringTheAcquisitionIsRefused) {
  PoseWindow seen = window();
  seen.samples["femur"] = samples_of(at_rest, 1, {4, 0, 0});
  const auto poses = poses_of_exposure(seen, plan());
  ASSERT_FALSE(poses);
  EXPECT_EQ(poses.error().reason, Reason::pose_spread);
  EXPECT_NE(poses.error().message.find("femur"), std::string::npos);
}

TEST(SeenPoses, PresentPosesNeedEveryMarker) {
  EXPECT_FALSE(poses_now(window(), plan()));
  PoseWindow seen = window();
  seen.samples["tibia"] = samples_of(at_rest, 4);
  EXPECT_TRUE(poses_now(seen, plan()));
}

TEST(SeenPoses, WindowIsRecordedToTheLastBit) {
  const PoseWindow seen = window();
  const PoseWindow read = pose_window_from(Json::parse(to_json(seen).dump()), "record").value();
  EXPECT_EQ(read.middle_s, seen.middle_s);
  ASSERT_EQ(read.samples.size(), seen.samples.size());
  for (const auto& [tool, samples] : seen.samples)
    for (std::size_t i = 0; i < samples.size(); ++i) {
      EXPECT_EQ(read.samples.at(tool)[i].time_s, samples[i].time_s);
      EXPECT_EQ(read.samples.at(tool)[i].tracker_from_tool.matrix(), samples[i].tracker_from_tool.matrix());
    }
}

}  // namespace seen_poses_test
}  // namespace helicarm::operation
