// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/slicer_sequence.h"

#include <gtest/gtest.h>

namespace helicarm::track {
namespace slicer_sequence_test {

std::vector<BodySequence> three_frames() {
  std::vector<BodySequence> bodies(1);
  std::vector<TrackedBody>& poses = bodies[0].smoothed;
  poses.resize(3);
  FramePose at;
  at.pose.translation = {1, 2, 3};
  at.pose.rotation = Eigen::AngleAxisd(EIGEN_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  poses[0].pose = at;
  poses[2].pose = at;
  return bodies;
}

TEST(SlicerSequence, IsRasWithGapsAndTimes) {
  const std::string text = slicer_sequence({"jaw"}, {10, 11, 12}, three_frames(), 250);
  // A quarter turn about x: z of RAS is z of LPS, y is turned over.
  EXPECT_NE(text.find("Seq_Frame0000_jawToWorldTransform = 1 0 0 -1 0 "), std::string::npos) << text;
  EXPECT_NE(text.find(" 1 -2 0 -1 "), std::string::npos) << text;
  EXPECT_EQ(text.find("Seq_Frame0001_jawToWorldTransform ="), std::string::npos);
  EXPECT_NE(text.find("Seq_Frame0001_jawToWorldTransformStatus = INVALID\n"), std::string::npos);
  EXPECT_NE(text.find("Seq_Frame0002_jawToWorldTransformStatus = OK\nSeq_Frame0002_Timestamp = 0.008000\n"),
            std::string::npos);
  EXPECT_NE(text.find("DimSize = 0 0 3\n"), std::string::npos);
  EXPECT_TRUE(text.ends_with("ElementDataFile = LOCAL\n"));
}

TEST(SlicerSequence, IndicesAreFramesWhereTimesWouldBeEqual) {
  for (const std::optional<double> rate : {std::optional<double>(), std::optional(2000.0)})
    EXPECT_NE(
        slicer_sequence({"jaw"}, {10, 11, 12}, three_frames(), rate).find("Seq_Frame0002_Timestamp = 12\n"),
        std::string::npos);
}

TEST(SlicerSequence, NamesThatSlicerWouldMisreadAreChanged) {
  const std::string text = slicer_sequence({"a=bStatus"}, {1, 2, 3}, three_frames(), {});
  EXPECT_NE(text.find("Seq_Frame0000_a-bstatusToWorldTransform = "), std::string::npos) << text;
}

}  // namespace slicer_sequence_test
}  // namespace helicarm::track
