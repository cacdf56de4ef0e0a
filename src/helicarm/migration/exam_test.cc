// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/exam.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/migration/migration_files.h"

namespace helicarm::migration {
namespace {

class ExamFiles : public testing::Test {
 protected:
  Expected<Exam> read(const char* name, const std::string& text, std::optional<int> frame = {}) {
    EXPECT_TRUE(write_file(folder_.path() / name, text));
    return read_exam(folder_.path() / name, frame);
  }

  TemporaryFolder folder_;
};

TEST_F(ExamFiles, ATableHoldsPlacesErrorsAndSegments) {
  const auto exam = read("a.csv",
                         "name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm,segment\nP1,1,2,3,0.1,0.2,0.3,tibia\n"
                         "P2,4,5,6,,,,tibia\nP3,7,8,9,,,,\n");
  ASSERT_TRUE(exam) << exam.error().message;
  EXPECT_EQ(exam->markers.size(), 3u);
  EXPECT_NEAR((*exam->markers[0].covariance)(2, 2), 0.09, 1e-12);
  EXPECT_FALSE(exam->markers[1].covariance);
  ASSERT_EQ(exam->segments.size(), 1u);
  EXPECT_EQ(exam->segments[0].markers, (std::vector<std::string>{"P1", "P2"}));
}

TEST_F(ExamFiles, ATableThatContradictsItselfIsRefused) {
  const std::string header = "name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm\n";
  EXPECT_EQ(read("a.csv", header + "P1,1,2,3,,,\nP1,1,2,4,,,\n").error().reason, Reason::name_clash);
  EXPECT_EQ(read("a.csv", header + "P1,1,2,3,0.1,,\n").error().reason, Reason::bad_value);
  EXPECT_EQ(read("a.csv", header + "P1,1,2,3,0,0,0\n").error().reason, Reason::bad_value);
  EXPECT_EQ(read("a.csv", "name,x_mm,y_mm,z_mm,unit\nP1,1,2,3,cm\n").error().reason, Reason::unknown_key);
  EXPECT_EQ(read_exam(folder_.path() / "none.csv").error().reason, Reason::missing_file);
  EXPECT_EQ(read("a.csv", header + "P1,1,2,3,,,\n", 2).error().reason, Reason::usage);
}

TEST_F(ExamFiles, OfTrackedMarkersOneFrameIsRead) {
  const std::string rows =
      "frame,name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm,ray_gap_mm,views,status\n"
      "1,P1,1,2,3,0.1,0.1,0.1,0.05,cam1 cam2,tracked\n1,P2,1,2,4,1,1,1,,,predicted\n"
      "2,P1,1,2,5,0.1,0.1,0.1,0.07,cam1 cam2,tracked\n";
  EXPECT_EQ(read("markers.csv", rows).error().reason, Reason::bad_value);
  EXPECT_EQ(read("markers.csv", rows, 3).error().reason, Reason::bad_value);
  const auto exam = read("markers.csv", rows, 1);
  ASSERT_TRUE(exam) << exam.error().message;
  ASSERT_EQ(exam->markers.size(), 1u);
  EXPECT_EQ(exam->markers[0].ray_gap_mm, 0.05);
  ASSERT_TRUE(
      write_file(folder_.path() / "track.json",
                 R"({"bodies": [{"name": "jaw", "markers": [{"name": "P1", "deviation_mm": 0.1}]}]})"));
  const auto folder = read_exam(folder_.path(), 2);
  ASSERT_TRUE(folder) << folder.error().message;
  EXPECT_EQ(folder->segments.at(0).name, "jaw");
}

TEST_F(ExamFiles, AMarkerThatWasNotTrackedStaysInItsBodyWithoutAPlace) {
  ASSERT_TRUE(write_file(folder_.path() / "track.json",
                         R"({"bodies": [{"name": "jaw", "markers": [{"name": "P1", "in_body_mm": [0, 0, 0]},
                             {"name": "P2", "in_body_mm": null}]}]})"));
  const auto exam = read("markers.csv",
                         "frame,name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm,ray_gap_mm,views,status\n"
                         "1,P1,1,2,3,0.1,0.1,0.1,0.05,cam1 cam2,tracked\n1,P2,,,,,,,,,lost\n");
  ASSERT_TRUE(exam) << exam.error().message;
  EXPECT_EQ(exam->segments.at(0).markers, (std::vector<std::string>{"P1", "P2"}));
  EXPECT_EQ(markers_of(*exam, exam->segments[0]).size(), 1u);
  EXPECT_EQ(candidates_for(*exam, "jaw").size(), 1u);
}

TEST_F(ExamFiles, TheHeaderTellsWhichTableItIs) {
  const auto own = read("markers.csv", "name,x_mm,y_mm,z_mm,segment\nP1,1,2,3,jaw\n");
  ASSERT_TRUE(own) << own.error().message;
  EXPECT_EQ(own->segments.at(0).name, "jaw");
  EXPECT_TRUE(read_exam(folder_.path()));
  const auto renamed = read("baseline.csv",
                            "frame,name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm,ray_gap_mm,views,status\n"
                            "7,P1,1,2,3,0.1,0.1,0.1,0.05,cam1 cam2,tracked\n",
                            7);
  ASSERT_TRUE(renamed) << renamed.error().message;
  EXPECT_EQ(renamed->markers.size(), 1u);
}

TEST_F(ExamFiles, OfAResultTheLocatedPointsAreRead) {
  const auto exam = read("result.json",
                         R"({"points": [{"name": "P1", "xyz_mm": [1, 2, 3], "ray_gap_mm": 0.1,
                             "covariance_mm2": [[1, 0, 0], [0, 2, 0], [0, 0, 3]]},
                             {"name": "P2", "xyz_mm": null, "reason": "not_seen"}]})");
  ASSERT_TRUE(exam) << exam.error().message;
  ASSERT_EQ(exam->markers.size(), 1u);
  EXPECT_EQ((*exam->markers[0].covariance)(1, 1), 2);
}

TEST_F(ExamFiles, ACaseIsMeasuredFirst) {
  ASSERT_TRUE(write_file(folder_.path() / "case.json", "{}"));
  EXPECT_NE(read_exam(folder_.path()).error().message.find("helicarm run"), std::string::npos);
}

TEST(Segments, AreReadFromText) {
  EXPECT_EQ(segment_from("cup=C1,C2,C3")->markers, (std::vector<std::string>{"C1", "C2", "C3"}));
  for (const char* text : {"", "cup", "=C1,C2,C3", "cup=C1,C2", "cup=C1,,C3"})
    EXPECT_FALSE(segment_from(text)) << text;
}

TEST_F(ExamFiles, AxesArePerpendicularAndRightHanded) {
  const auto axes = [&](const std::string& rows) {
    EXPECT_TRUE(write_file(folder_.path() / "axes.csv", "axis,x,y,z\n" + rows));
    return read_axes(folder_.path() / "axes.csv");
  };
  EXPECT_TRUE(axes("x,0,1,0\ny,-1,0,0\nz,0,0,1\n"));
  EXPECT_FALSE(axes("x,0,1,0\ny,1,0,0\nz,0,0,1\n"));
  EXPECT_FALSE(axes("x,1,0,0\ny,0,1,0\n"));
  EXPECT_FALSE(axes("x,1,0,0\nx,0,1,0\nz,0,0,1\n"));
  EXPECT_FALSE(axes("x,1,0.1,0\ny,0,1,0\nz,0,0,1\n"));
}

}  // namespace
}  // namespace helicarm::migration
