// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/xmalab_points.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::track {
namespace xmalab_points_test {

class XmalabPoints : public testing::Test {
 protected:
  std::filesystem::path file(const std::string& text) {
    EXPECT_TRUE(write_file(folder_.path() / "points.csv", text));
    return folder_.path() / "points.csv";
  }
  Failure refusal(const std::string& text, std::size_t cameras = 2) {
    const auto read = read_xmalab_points2d(file(text), cameras);
    return read ? Failure{Reason::usage, "accepted"} : read.error();
  }

  TemporaryFolder folder_;
};

TEST_F(XmalabPoints, AreReadByMarkerAndCamera) {
  const auto read =
      read_xmalab_points2d(file("a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y, b_cam1_X,b_cam1_Y,b_cam2_X,b_cam2_Y\r\n"
                                "1,2,3,4.5,NaN,NaN,7,8\r\n\r\n9,10,NaN,NaN,11,12,,\r\n"),
                           2);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->markers, (std::vector<std::string>{"a", "b"}));
  ASSERT_EQ(read->rows.size(), 2u);
  EXPECT_EQ(read->rows[0][1], Eigen::Vector2d(3, 4.5));
  EXPECT_FALSE(read->rows[0][2]);
  EXPECT_EQ(read->rows[0][3], Eigen::Vector2d(7, 8));
  EXPECT_EQ(read->rows[1][2], Eigen::Vector2d(11, 12));
  EXPECT_FALSE(read->rows[1][3]);
}

TEST_F(XmalabPoints, OffsetColumnsOfNoughtAreLeftOut) {
  // The names as XMALab writes them, and as its MATLAB tools do.
  for (const char* header : {"cam0_offsetcam1_offseta_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\n",
                             "cam1_offset,cam2_offset,a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\n"}) {
    const auto read = read_xmalab_points2d(file(header + std::string("0,0,1,2,3,4\n")), 2);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->markers, std::vector<std::string>{"a"});
    EXPECT_EQ(read->rows[0][1], Eigen::Vector2d(3, 4));
    EXPECT_EQ(refusal(header + std::string("0,2,1,2,3,4\n")).reason, Reason::unsupported);
  }
}

TEST_F(XmalabPoints, BrokenFilesAreNamed) {
  EXPECT_EQ(refusal("").reason, Reason::bad_value);
  EXPECT_EQ(refusal("1.5,2,3,4\n1,2,3,4\n").reason, Reason::unsupported);
  EXPECT_EQ(refusal("a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Z\n").reason, Reason::bad_value);
  EXPECT_EQ(refusal("a_cam1_X,a_cam1_Y,a_cam2_X\n").reason, Reason::bad_value);
  EXPECT_EQ(refusal("a_cam1_X,a_cam1_Y,a_cam3_X,a_cam3_Y\n").reason, Reason::bad_value);
  EXPECT_EQ(refusal("a_cam1_X,a_cam1_Y,a_cam1_X,a_cam1_Y\n", 1).reason, Reason::name_clash);
  const std::string header = "a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\n";
  EXPECT_NE(refusal(header + "1,2,3\n").message.find("row 1: 3 fields, the header has 4"), std::string::npos);
  EXPECT_NE(refusal(header + "1,2,3,4\n1,2,3,x\n").message.find("row 2: a_cam2_Y"), std::string::npos);
  EXPECT_EQ(refusal(header + "1,NaN,3,4\n").reason, Reason::bad_value);
  EXPECT_EQ(refusal(header + "1,inf,3,4\n").reason, Reason::bad_value);
  EXPECT_EQ(read_xmalab_points2d(folder_.path() / "none.csv", 2).error().reason, Reason::missing_file);
}

TEST_F(XmalabPoints, GeometryIsTheFirstRowThatHasAllMarkers) {
  const auto path = file(
      "Frame,a_X,a_Y,a_Z,b_X,b_Y,b_Z,c_X,c_Y,c_Z\n1,NaN,NaN,NaN,4,5,6,7,8,9\n2,1,2,3,4,5,6,NaN,NaN,NaN\n");
  const auto read = read_xmalab_points3d(path, {"b", "a"});
  ASSERT_TRUE(read && *read);
  EXPECT_EQ((**read)[0], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ((**read)[1], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read_xmalab_points3d(path, {"a", "d"}).error().reason, Reason::bad_value);
  EXPECT_EQ(read_xmalab_points3d(path, {"a", "c"}).error().reason, Reason::bad_value);
  EXPECT_FALSE(*read_xmalab_points3d(file("name,x_mm,y_mm,z_mm\na,1,2,3\n"), {"a"}));
}

}  // namespace xmalab_points_test
}  // namespace helicarm::track
