// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::report {
namespace {

/// The cell of a row by its column's title.
std::string cell(const Table& table, std::size_t row, const std::string& title) {
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (table.columns[i].title == title) return table.rows.at(row).at(i).text;
  return "no column " + title;
}

pipeline::PointResult located(const std::string& name, double sigma_mm) {
  pipeline::PointResult point;
  point.name = name;
  point.source = localization::PointSource::pick;
  point.place = guidance::PointInFrames{};
  point.place->in_calibrator = {1, -2.5, 3};
  point.place->covariance_in_calibrator = sigma_mm * sigma_mm * Eigen::Matrix3d::Identity();
  point.ray_gap_mm = 0.25;
  return point;
}

TEST(PointsTable, LocatedPointHasItsPositionAndErrors) {
  const Table table = points_table({located("FS", 0.1), located("FE", 0.2)});
  EXPECT_EQ(cell(table, 0, "Point"), "FS");
  EXPECT_EQ(cell(table, 0, "y, mm"), "-2.500");
  EXPECT_EQ(cell(table, 0, "σ z, mm"), "0.100");
  EXPECT_EQ(cell(table, 0, "Ray gap, mm"), "0.250");
  EXPECT_EQ(cell(table, 0, "±95 %, mm"), "0.279");  // 2.795 sigma: root of chi2(3) at 95 %
}

TEST(PointsTable, BarsAreProportionalToTheLargestError) {
  const Table table = points_table({located("FS", 0.1), located("FE", 0.2)});
  EXPECT_NEAR(table.rows[0][2].share, 0.5, 1e-9);
  EXPECT_NEAR(table.rows[1][2].share, 1, 1e-9);
}

TEST(PointsTable, PointWithoutPlaceHasItsReasonAndNoNumber) {
  pipeline::PointResult lost;
  lost.name = "FE";
  lost.source = localization::PointSource::pick;
  lost.reason = Failure{Reason::not_seen, "is in one view only", "AP", {}};
  const Table table = points_table({lost});
  EXPECT_EQ(cell(table, 0, "Remark"), "AP: is in one view only (not_seen)");
  EXPECT_TRUE(table.rows[0].back().is_bad);
  for (const char* title : {"x, mm", "σ x, mm", "±95 %, mm", "Ray gap, mm"})
    EXPECT_EQ(cell(table, 0, title), "–") << title;
}

TEST(PointsTable, MissingRaysAreMarked) {
  pipeline::PointResult point = located("FS", 0.1);
  point.rays_miss = true;
  EXPECT_TRUE(points_table({point}).rows[0][3].is_bad);
}

TEST(VerificationTable, TrackerAndImagesMayEachBeMissing) {
  ToolAtEnd by_tracker{"femur", "start", 0.5, 0.25, {}};
  ToolAtEnd by_images{"femur", "end", {}, {}, guidance::LineError{{}, 1, 2, 3}};
  const Table table = verification_table({by_tracker, by_images});
  EXPECT_EQ(cell(table, 0, "Error, mm"), "0.50");
  EXPECT_EQ(cell(table, 0, "In space, mm"), "–");
  EXPECT_EQ(cell(table, 1, "Predicted rms, mm"), "–");
  EXPECT_EQ(cell(table, 1, "Eq. 17, mm"), "2.00");
}

pipeline::ViewResult view_with(std::size_t fiducials) {
  pipeline::ViewResult view;
  view.name = "AP";
  view.found = fiducials::LabelledFiducials{};
  view.found->fiducials.resize(fiducials);
  return view;
}

TEST(CalibrationTable, RefusedViewHasItsFiducialsOnly) {
  pipeline::ViewResult view = view_with(12);
  view.found->fiducials[3].status = fiducials::FiducialStatus::used;
  const Table table = calibration_table({view});
  EXPECT_EQ(cell(table, 0, "Fiducials"), "1 of 12");
  EXPECT_EQ(cell(table, 0, "fx, px"), "–");
}

TEST(FiducialsTable, OneThatIsNotSeenHasNoPosition) {
  pipeline::ViewResult view = view_with(2);
  view.found->fiducials[0].status = fiducials::FiducialStatus::occluded;
  view.found->fiducials[1].status = fiducials::FiducialStatus::used;
  view.found->fiducials[1].uv = {3, 4};
  const Table table = fiducials_table({view});
  EXPECT_EQ(cell(table, 0, "Status"), "occluded");
  EXPECT_EQ(cell(table, 0, "u, px"), "–");
  EXPECT_EQ(cell(table, 1, "v, px"), "4.00");
  EXPECT_EQ(cell(table, 1, "Residual, px"), "–");  // not calibrated
}

TEST(RectificationTable, ImageWithoutDistortionHasNoResiduals) {
  pipeline::ViewResult view;
  view.name = "AP";
  view.rectification = rectification::Rectification{};
  view.rectification->map = rectification::identity_map(64, 48, 0.2);
  const Table table = rectification_table({view});
  EXPECT_EQ(cell(table, 0, "Model"), "identity");
  EXPECT_EQ(cell(table, 0, "Residual rms, px"), "–");
  EXPECT_EQ(cell(table, 0, "Dots"), "–");
}

TEST(Tables, EveryRowHasACellPerColumn) {
  pipeline::Result result;
  result.points = {located("FS", 0.1), located("FE", 0.2)};
  result.tunnels.push_back({"femur", {}, {}, {}, 30});
  result.accuracy.fre_mm = {0.1, 0.1, 0.2, 0.05, 12};
  result.timing_ms.total = 12;
  const std::vector<Table> tables = tables_of(result);
  ASSERT_EQ(tables.size(), 4u);
  for (const Table& table : tables)
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size()) << table.heading;
}

TEST(Tables, EmptyResultHasNone) { EXPECT_TRUE(tables_of({}).empty()); }

TEST(MessageOf, ViewAndCodeAreNamed) {
  EXPECT_EQ(message_of({Reason::blank_image, "nothing to see", "AP", {}}),
            "AP: nothing to see (blank_image)");
  EXPECT_THAT(message_of({Reason::blank_image, "nothing to see", "", {}}), testing::StartsWith("nothing"));
}

}  // namespace
}  // namespace helicarm::report
