// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "helicarm/case_registration/plan.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::case_registration {
namespace fcsv_test {

using Eigen::Vector3d;
using testing::HasSubstr;

const std::string columns = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n";
const std::string first_row = "1,1,2,3,0,0,0,1,1,1,0,entry,,vtkMRMLScalarVolumeNode1\n";

std::string header(const std::string& system) {
  return "# Markups fiducial file version = 4.11\n# CoordinateSystem = " + system + "\n" + columns;
}

Expected<MarkupPlan> plan_of(const std::string& text, const std::string& name = "F.fcsv") {
  const TemporaryFolder folder;
  EXPECT_TRUE(write_file(folder.path() / name, text));
  return read_plan(folder.path() / name);
}

void expect_refused(const std::string& text, Reason reason, const std::string& words) {
  const auto plan = plan_of(text);
  ASSERT_FALSE(plan) << text;
  EXPECT_EQ(plan.error().reason, reason) << plan.error().message;
  EXPECT_THAT(plan.error().message, testing::StartsWith("F.fcsv: "));
  EXPECT_THAT(plan.error().message, HasSubstr(words));
}

TEST(Fcsv, CoordinateSystemsByNameAndNumberBecomeLps) {
  for (const auto& [system, at] : {std::pair{"LPS", Vector3d(1, 2, 3)},
                                   {"1", Vector3d(1, 2, 3)},
                                   {"RAS", Vector3d(-1, -2, 3)},
                                   {"0", Vector3d(-1, -2, 3)}}) {
    const auto plan = plan_of(header(system) + first_row);
    ASSERT_TRUE(plan) << plan.error().message;
    ASSERT_EQ(plan->points.size(), 1U);
    EXPECT_EQ(plan->points[0].name, "entry");
    EXPECT_EQ(plan->points[0].in_model, at) << system;
    EXPECT_TRUE(plan->tunnels.empty());
  }
}

TEST(Fcsv, RowsAsSlicerWritesThem) {
  const std::string rows =
      "vtkMRMLMarkupsFiducialNode_0,-32.690,4.1,-1.5e1,0.000,0.000,0.000,1.000,1,1,0,\"femur, "
      "\"\"origin\"\"\",\"a, b\",\r\n"
      ",7,8,9,0,0,0,1,1,1,0,, , \r\n";
  const auto plan = plan_of("\xEF\xBB\xBF" + header("LPS") + "\r\n" + rows);
  ASSERT_TRUE(plan) << plan.error().message;
  ASSERT_EQ(plan->points.size(), 2U);
  EXPECT_EQ(plan->points[0].name, "femur, \"origin\"");
  EXPECT_EQ(plan->points[0].in_model, Vector3d(-32.69, 4.1, -15));
  EXPECT_EQ(plan->points[1].name, "F-2");
  EXPECT_EQ(plan->points[1].in_model, Vector3d(7, 8, 9));
}

TEST(Fcsv, OnlyPlacedPointsOfSlicerFive) {
  const std::string rows =
      "1,1,2,3,0,0,0,1,1,1,0,placed,,,2,0\n2,0,0,0,0,0,0,1,1,1,0,planned,,,0,0\n3,0,0,0,0,0,0,1,1,1,0,"
      "previewed,,,1,0\n";
  const auto plan = plan_of(header("LPS") + rows);
  ASSERT_TRUE(plan) << plan.error().message;
  ASSERT_EQ(plan->points.size(), 1U);
  EXPECT_EQ(plan->points[0].name, "placed");
}

TEST(Fcsv, ColumnsAreTakenByName) {
  const std::string head = "# Markups fiducial file version = 4.6\n# CoordinateSystem = 0\n";
  const auto plan = plan_of(head + "# columns = label,z,y,x,sel,vis\nentry,3,2,1,1,1\n");
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->points[0].in_model, Vector3d(-1, -2, 3));
  EXPECT_EQ(plan_of(head + "# columns = x,y,z\n1,2,3\n")->points[0].name, "F-1");
}

TEST(Fcsv, IsKnownByItsFirstLineToo) {
  EXPECT_TRUE(plan_of(header("LPS") + first_row, "points.txt"));
  EXPECT_TRUE(plan_of("# CoordinateSystem = LPS\n" + columns + first_row, "F.FCSV"));
}

TEST(Fcsv, WhatIsNotDeclaredIsRefusedWithTheReason) {
  expect_refused("# Markups fiducial file version = 4.11\n" + columns + first_row, Reason::bad_value,
                 "no line \"# CoordinateSystem = \" states whether the points are in LPS or RAS");
  expect_refused(
      "# Fiducial List file F.fcsv\n# version = 2\n# columns = label,x,y,z,sel,vis\nF1,1,2,3,1,1\n",
      Reason::bad_value, "no line \"# CoordinateSystem = \"");
  expect_refused("# CoordinateSystem = LPS\n" + first_row, Reason::bad_value, "no line \"# columns = \"");
  expect_refused("# CoordinateSystem = LPS\n# columns = id,x,y,label\n1,2,3,a\n", Reason::bad_value,
                 "columns: \"z\" occurs 0 times");
  expect_refused("# CoordinateSystem = LPS\n# columns = x,y,z,x\n1,2,3,4\n", Reason::bad_value,
                 "\"x\" occurs 2 times");
  expect_refused(header("2") + first_row, Reason::unsupported, "CoordinateSystem is \"2\", must be LPS");
  expect_refused(header("IJK") + first_row, Reason::unsupported, "CoordinateSystem is \"IJK\"");
  expect_refused("# CoordinateSystem = RAS\n" + header("LPS") + first_row, Reason::bad_value,
                 "remove the wrong one");
}

TEST(Fcsv, ADeclaredUnitIsConverted) {
  const auto plan = plan_of("# units = cm\n" + header("RAS") + first_row);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->points[0].in_model, Vector3d(-10, -20, 30));
}

TEST(Fcsv, BrokenRowsAreNamed) {
  const std::string head = header("LPS") + first_row;
  const std::string rest = ",0,0,0,1,1,1,0,exit,,\n";
  expect_refused(head + "2,4,5\n", Reason::bad_value, "row 2: 3 fields, \"# columns = \" names 14");
  expect_refused(head + "2,4,5,nan" + rest, Reason::not_finite, "row 2: z is \"nan\", must be finite");
  expect_refused(head + "2,4,5,1e999" + rest, Reason::not_finite, "z is \"1e999\"");
  expect_refused(head + "2,4,,6" + rest, Reason::bad_value, "row 2: y is \"\", must be a number");
  expect_refused(head + "2,4,5,20000" + rest, Reason::bad_value,
                 "\"exit\" at (4, 5, 20000) mm, must lie within 10000 mm");
  expect_refused(head + first_row, Reason::name_clash, "\"entry\" is given twice");
  expect_refused(head + "2,4,5,6,0,0,0,1,1,1,0,\"exit,,\n", Reason::truncated,
                 "row 2: a quoted field does not end");
  expect_refused(head +
                     "2,4,5,6,0,0,0,1,1,1,0,Oberfl\xE4"
                     "che,,\n",
                 Reason::bad_value, "row 2: is not UTF-8");
}

TEST(Fcsv, LandmarksAreReadFromEachOfSlicersFilesAndFromCsv) {
  const TemporaryFolder folder;
  const auto landmarks = [&](const char* name, const std::string& text) {
    EXPECT_TRUE(write_file(folder.path() / name, text));
    return guarded([&] { return read_landmarks(folder.path() / name); });
  };
  const std::string markups =
      R"({"markups": [{"type": "Fiducial", "coordinateSystem": "RAS", "controlPoints": [{"label": "entry", "position": [-1, -2, 3]}]}]})";
  for (const auto& read : {landmarks("a.fcsv", header("LPS") + first_row), landmarks("a.mrk.json", markups),
                           landmarks("a.csv", "name,x_mm,y_mm,z_mm\nentry,1,2,3\n")}) {
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->size(), 1U);
    EXPECT_EQ((*read)[0].name, "entry");
    EXPECT_EQ((*read)[0].in_model, Vector3d(1, 2, 3));
  }
  EXPECT_EQ(landmarks("b.csv", "name,x_mm,y_mm,z_mm\na,1,2,3\na,1,2,4\n").error().reason, Reason::name_clash);
  EXPECT_EQ(landmarks("c.csv", "name,x,y,z\na,1,2,3\n").error().reason, Reason::bad_value);
}

}  // namespace fcsv_test
}  // namespace helicarm::case_registration
