// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/image_measures.h"

#include <QClipboard>
#include <QGuiApplication>
#include <QTest>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/xray/measure_tool.h"
#include "gui/xray/measures_panel.h"
#include "gui/xray/simulated_result_test.h"

namespace helicarm::gui {
namespace {

using measures::Kind;

std::string image_of(std::size_t view) {
  return simulated_result()->views[view].xray_image->acquisition.instance_key;
}

/// The raw pixel of a place of the calibrator's frame.
Eigen::Vector2d raw_of(std::size_t view, const Eigen::Vector3d& place) {
  const pipeline::ViewResult& in = simulated_result()->views[view];
  return in.rectification->map.raw_from_rectified(in.calibrated->view.project(place));
}

TEST(EvaluatedMeasure, DistanceOfTwoFiducialsInTheirPlane) {
  const geometry::View& view = simulated_result()->views[0].calibrated->view;
  const pipeline::PointResult& point = simulated_result()->points[0];
  const Eigen::Vector3d here = point.place->in_calibrator;
  const Eigen::Vector3d there =
      here + view.camera_from_world.rotation.transpose() * Eigen::Vector3d(18, -24, 0);
  const ImageMeasure measure{
      1, Kind::distance, image_of(0), {{"from", raw_of(0, here)}, {"to", raw_of(0, there)}}};
  const EvaluatedMeasure done = evaluated(measure, *simulated_result(), {.point = point.name});
  ASSERT_EQ(done.lines.size(), 1u);
  EXPECT_EQ(done.lines[0].value, "30.00 mm");
  EXPECT_TRUE(done.lines[0].within.startsWith("±0.")) << done.lines[0].within.toStdString();
  EXPECT_EQ(done.lines[0].view, "AP");
  EXPECT_EQ(done.strokes.size(), 1u);
}

TEST(EvaluatedMeasure, IsInPixelsWithoutCalibrationAndRectification) {
  pipeline::Result bare;
  bare.views.push_back({"AP", simulated_result()->views[0].xray_image, {}, {}, {}});
  const ImageMeasure measure{1, Kind::distance, image_of(0), {{"from", {100, 100}}, {"to", {130, 140}}}};
  const EvaluatedMeasure done = evaluated(measure, bare, {});
  ASSERT_EQ(done.lines.size(), 1u);
  EXPECT_EQ(done.lines[0].value, "50.0 px");
}

TEST(EvaluatedMeasure, QuadrantsGiveThePicksOfTheFemurOnly) {
  const ImageMeasure measure{
      1,
      Kind::femoral_quadrants,
      image_of(1),
      {{"blumensaat_posterior", {200, 250}}, {"blumensaat_anterior", {300, 240}}, {"inferior", {250, 320}}},
      true};
  const EvaluatedMeasure done = evaluated(measure, *simulated_result(), {});
  std::vector<std::string> points;
  for (const auto& [at, words] : done.positions) points.push_back(words.section(':', 0, 0).toStdString());
  EXPECT_THAT(points, testing::ElementsAre("FS", "FE"));
  EXPECT_EQ(done.lines.size(), 2u + 2 * 2 + 2);  // both lie outside, and a line says so
  EXPECT_EQ(done.strokes.size(), 10u);
}

TEST(EvaluatedMeasure, PointWhoseRaysMissIsGivenByItsProjection) {
  pipeline::Result result = *simulated_result();
  const ImageMeasure measure{
      1, Kind::tibia_ml, image_of(0), {{"medial", {150, 300}}, {"lateral", {350, 300}}}};
  const auto line_of = [&](const std::string& name) {
    for (const MeasuredLine& line : evaluated(measure, result, {}).lines)
      if (line.what.startsWith(QString::fromStdString(name))) return line;
    throw std::out_of_range(name);
  };
  auto point = std::ranges::find(result.points, "TS", &pipeline::PointResult::name);
  const QString as_picked = line_of("TS").within;
  point->rays_miss = true;
  point->place->covariance_in_calibrator = 9 * Eigen::Matrix3d::Identity();
  const auto number = [](QString words) { return words.remove("±").section(' ', 0, 0).toDouble(); };
  EXPECT_GT(number(line_of("TS").within), 5 * number(as_picked));
}

TEST(EvaluatedMeasure, OfAnotherImageIsNotShown) {
  EXPECT_TRUE(evaluated({1, Kind::distance, "other", {}}, *simulated_result(), {}).lines.empty());
}

TEST(MeasureTool, AsksForEachClickAndEndsADistanceByItself) {
  MeasureTool tool;
  tool.begin(Kind::distance);
  EXPECT_TRUE(tool.hint().contains("the first point"));
  tool.click("image", {1, 2});
  EXPECT_TRUE(tool.hint().contains("the second point"));
  tool.click("another", {9, 9});
  EXPECT_EQ(tool.measures()[0].clicks.size(), 1u);
  tool.click("image", {3, 4});
  tool.click("image", {5, 6});
  ASSERT_EQ(tool.measures().size(), 2u);
  EXPECT_TRUE(is_complete(tool.measures()[0]));
  tool.leave();
  EXPECT_EQ(tool.measures().size(), 1u);  // the unfinished one is gone
  tool.click("image", {1, 2});
  EXPECT_EQ(tool.measures().size(), 1u);
}

TEST(MeasureTool, EnterLeavesOutTheOptionalClicksThenEnds) {
  MeasureTool tool;
  tool.begin(Kind::tibia_ap);
  tool.finish();
  tool.click("image", {1, 2});
  tool.finish();  // needs the other margin
  tool.click("image", {90, 2});
  EXPECT_FALSE(is_complete(tool.measures()[0]));
  tool.finish();
  EXPECT_TRUE(is_complete(tool.measures()[0]));
  tool.click("image", {40, 5});
  tool.click("image", {50, 5});
  EXPECT_EQ(tool.measures()[0].clicks[2].name, "point 1");
  EXPECT_EQ(tool.measures()[0].clicks[3].name, "point 2");
  tool.finish();
  tool.click("image", {7, 7});
  EXPECT_EQ(tool.measures().size(), 2u);
}

TEST(MeasureTool, MovesAClick) {
  MeasureTool tool;
  tool.begin(Kind::distance);
  tool.click("image", {1, 2});
  tool.click("image", {3, 4});
  tool.move(1, 1, {30, 40});
  tool.move(1, 9, {0, 0});
  tool.move(7, 0, {0, 0});
  EXPECT_EQ(tool.measures()[0].clicks[1].raw, Eigen::Vector2d(30, 40));
  EXPECT_EQ(tool.measures()[0].clicks[0].raw, Eigen::Vector2d(1, 2));
}

class MeasuresPanelTest : public testing::Test {
 protected:
  MeasuresPanelTest() { panel.show_result(simulated_result()); }
  void press(const char* name) { QTest::mouseClick(panel.findChild<QPushButton*>(name), Qt::LeftButton); }
  MeasureTool tool;
  MeasuresPanel panel{tool};
};

TEST_F(MeasuresPanelTest, ListsCopiesAndRemovesMeasures) {
  press("measure_distance");
  EXPECT_EQ(tool.kind(), Kind::distance);
  for (const double u : {100.0, 140.0, 150.0, 160.0}) tool.click(image_of(0), {u, 200});
  auto* table = panel.findChild<QTableWidget*>("measuresTable");
  ASSERT_EQ(table->rowCount(), 2);
  press("copyMeasures");
  const QString copied = QGuiApplication::clipboard()->text();
  EXPECT_EQ(copied.count('\n'), 3);
  EXPECT_TRUE(copied.contains("1\tDistance\tAP\tlength\t")) << copied.toStdString();
  table->setCurrentCell(0, 0);
  press("removeMeasure");
  ASSERT_EQ(table->rowCount(), 1);
  EXPECT_EQ(table->item(0, 0)->text(), "2");
  press("clearMeasures");
  EXPECT_EQ(table->rowCount(), 0);
  press("measure_distance");
  EXPECT_FALSE(tool.kind());
}

TEST_F(MeasuresPanelTest, NearerPlaneGivesShorterLengths) {
  tool.begin(Kind::distance);
  for (const double u : {100.0, 200.0}) tool.click(image_of(0), {u, 200});
  auto* table = panel.findChild<QTableWidget*>("measuresTable");
  auto* plane = panel.findChild<QComboBox*>("measurePlane");
  const auto value = [&] { return table->item(0, 4)->text().section(' ', 0, 0).toDouble(); };
  plane->setCurrentIndex(1);
  panel.findChild<QDoubleSpinBox*>("measureDepth")->setValue(800);
  const double far = value();
  panel.findChild<QDoubleSpinBox*>("measureDepth")->setValue(400);
  EXPECT_NEAR(value(), 0.5 * far, 0.01);
  EXPECT_EQ(plane->itemText(2), "through FS");
}

}  // namespace
}  // namespace helicarm::gui
