// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/sequence_file.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"

namespace helicarm::tracker {
namespace sequence_file_test {

class SequenceFile : public testing::Test {
 protected:
  ~SequenceFile() override { std::filesystem::remove(path_); }
  Expected<std::vector<SequenceFrame>> read(const std::string& text) {
    EXPECT_TRUE(write_file(path_, text));
    return read_sequence(path_);
  }
  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("helicarm-sequence-" + std::to_string(::getpid()) + ".mha");
};

const std::string pose_line =
    "Seq_Frame0000_ToolToTrackerTransform = 1 0 0 10 0 1 0 20 0 0 1 -3e-018 0 0 0 1 \n";
const std::string time_line = "Seq_Frame0000_Timestamp = 12.5\n";
const std::string end_line = "ElementDataFile = LOCAL\n";

TEST_F(SequenceFile, PosesStatusAndTimeAreRead) {
  const auto frames = read("ObjectType = Image\r\nDimSize = 0 0 2          \n" + pose_line +
                           "Seq_Frame0000_ToolToTrackerTransformStatus = OK\n" + time_line +
                           "Seq_Frame0007_ToolToTrackerTransformStatus = MISSING\n"
                           "Seq_Frame0007_ToolToTrackerTransform = nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
                           "Seq_Frame0007_Timestamp = 13\nSeq_Frame0007_Other = text = more\n" +
                           end_line + std::string("\0\1binary = data", 15));
  ASSERT_TRUE(frames) << frames.error().message;
  ASSERT_EQ(frames->size(), 2u);
  EXPECT_EQ((*frames)[0].time_s, 12.5);
  EXPECT_EQ((*frames)[0].poses.at("ToolToTracker").matrix(1, 3), 20);
  EXPECT_TRUE((*frames)[0].poses.at("ToolToTracker").visible);
  EXPECT_FALSE((*frames)[1].poses.at("ToolToTracker").visible);
  EXPECT_TRUE(std::isnan((*frames)[1].poses.at("ToolToTracker").matrix(0, 0)));
}

TEST_F(SequenceFile, RoundTripIsBitExact) {
  std::vector<SequenceFrame> frames(12);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].time_s = 0.1 * static_cast<double>(i);
    frames[i].poses["FemurToTracker"] = {Eigen::Matrix4d::Random(), true};
    if (i % 2) frames[i].poses["TibiaToTracker"] = {Eigen::Matrix4d::Random(), false};
  }
  ASSERT_TRUE(write_sequence(path_, frames));
  const auto back = read_sequence(path_);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->size(), frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ((*back)[i].time_s, frames[i].time_s);
    ASSERT_EQ((*back)[i].poses.size(), frames[i].poses.size());
    for (const auto& [name, pose] : frames[i].poses) {
      EXPECT_EQ((*back)[i].poses.at(name).matrix, pose.matrix);
      EXPECT_EQ((*back)[i].poses.at(name).visible, pose.visible);
    }
  }
}

TEST_F(SequenceFile, InvalidFilesAreRefused) {
  const auto reason = [&](const std::string& text) {
    const auto frames = read(text);
    EXPECT_FALSE(frames) << text;
    return frames ? Reason::usage : frames.error().reason;
  };
  EXPECT_EQ(reason(""), Reason::truncated);
  EXPECT_EQ(reason(pose_line + time_line), Reason::truncated);
  EXPECT_EQ(reason(pose_line + end_line), Reason::bad_value);  // no time
  EXPECT_EQ(reason("no header\n" + end_line), Reason::bad_value);
  EXPECT_EQ(reason(time_line + "Seq_Frame0000_ATransform = 1 2 3\n" + end_line), Reason::bad_value);
  EXPECT_EQ(reason(time_line + "Seq_Frame0000_ATransform = 1,0 2\n" + end_line), Reason::bad_value);
  EXPECT_EQ(reason("Seq_Frame0000_Timestamp = soon\n" + end_line), Reason::bad_value);
  EXPECT_EQ(read_sequence(path_ / "absent").error().reason, Reason::missing_file);
}

TEST_F(SequenceFile, LongerKeyThanElementDataFileIsTruncated) {
  EXPECT_EQ(read("ElementDataFileX=").error().reason, Reason::truncated);
  EXPECT_EQ(read("ElementDataFile").error().reason, Reason::truncated);
}

TEST_F(SequenceFile, ElementDataFileNeedsNoNewline) { EXPECT_TRUE(read("ElementDataFile=LOCAL")); }

TEST_F(SequenceFile, TimeOutOfRangeIsRefused) {
  for (const char* time : {"nan", "inf", "-inf", "1e300", "-5e9"})
    EXPECT_EQ(read(std::string("Seq_Frame0000_Timestamp = ") + time + "\n" + end_line).error().reason,
              Reason::bad_value)
        << time;
}

TEST_F(SequenceFile, InvalidNameIsRefused) {
  SequenceFrame frame;
  frame.poses["a = 1\nb"] = {};
  EXPECT_EQ(write_sequence(path_, {frame}).error().reason, Reason::bad_value);
}

TEST_F(SequenceFile, TransformsOfSlicerAreTurnedToLps) {
  const std::string jaw = "_jawToWorldTransform = 0 -1 0 10 1 0 0 20 0 0 1 30 0 0 0 1\n";
  ASSERT_TRUE(write_file(
      path_, "Seq_Frame0000" + jaw + "Seq_Frame0000_Timestamp = 5\n" +
                 "Seq_Frame0001_jawToWorldTransformStatus = INVALID\nSeq_Frame0001_Timestamp = 6\n" +
                 "Seq_Frame0002" + jaw + "Seq_Frame0002_Timestamp = 7\n" + end_line));
  const auto read = read_slicer_sequence(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->index, (std::vector<double>{5, 6, 7}));
  const auto& of = read->transforms.at("jawToWorld");
  ASSERT_EQ(of.size(), 3u);
  EXPECT_FALSE(of[1]);
  EXPECT_EQ(of[2]->translation, Eigen::Vector3d(-10, -20, 30));
  EXPECT_EQ(of[2]->rotation * Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY());
}

TEST_F(SequenceFile, SequencesThatAreNoMotionsAreRefused) {
  ASSERT_TRUE(write_file(path_, time_line + end_line));
  EXPECT_EQ(read_slicer_sequence(path_).error().reason, Reason::no_pose);
  ASSERT_TRUE(write_file(
      path_, "Seq_Frame0000_aTransform = 2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1\n" + time_line + end_line));
  EXPECT_EQ(read_slicer_sequence(path_).error().reason, Reason::bad_value);
}

}  // namespace sequence_file_test
}  // namespace helicarm::tracker
