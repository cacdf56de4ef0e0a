// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/marks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/xray/simulated_result_test.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;

TEST(MarksOf, SimulatedCaseHasAllKinds) {
  const report::ViewMarks marks = marks_of(*simulated_result(), 0, Layer::rectified);
  EXPECT_EQ(marks.balls.size(), 12u);
  EXPECT_EQ(marks.false_blobs.empty(), false);
  EXPECT_GT(marks.plate_dots.size(), 30u);
  EXPECT_EQ(marks.points.size(), 4u);
  EXPECT_EQ(marks.tunnels.size(), 2u);
  EXPECT_EQ(marks.tool_lines.size(), 2u);
  for (const report::BallMark& ball : marks.balls) EXPECT_TRUE(ball.residual) << ball.label;
}

TEST(MarksOf, RawLayerHasTheRawPositions) {
  const pipeline::Result& result = *simulated_result();
  const report::ViewMarks raw = marks_of(result, 1, Layer::raw);
  for (const report::BallMark& ball : raw.balls) {
    const auto& all = result.views[1].found->fiducials;
    const auto same = std::ranges::find(all, ball.label, &fiducials::Fiducial::label);
    EXPECT_LT((ball.place - same->uv_raw).norm(), 1e-6) << ball.label;
  }
  const auto& dots = result.views[1].rectification->plate_dots;
  ASSERT_EQ(raw.plate_dots.size(), dots.size());
  for (std::size_t i = 0; i < dots.size(); ++i)
    EXPECT_LT((raw.plate_dots[i].place - dots[i].centre_px).norm(), 1e-6);
}

TEST(InLayer, RoundTripReturnsTheSamePixel) {
  const pipeline::ViewResult& view = simulated_result()->views[0];
  const Vector2d place(300, 220);
  for (const Layer layer : {Layer::raw, Layer::rectified, Layer::inpainted}) {
    const auto raw = raw_from_layer(view, layer, place);
    ASSERT_TRUE(raw);
    EXPECT_LT((*layer_from_raw(view, layer, *raw) - place).norm(), 1e-6);
    EXPECT_FALSE(raw_from_layer(view, layer, {-50, 100}));
  }
  EXPECT_EQ(raw_from_layer(view, Layer::raw, place), place);
  EXPECT_EQ(in_layer(view, Layer::rectified, place), place);
}

TEST(InLayer, PathsEndAtTheImageBorder) {
  const pipeline::ViewResult& view = simulated_result()->views[0];
  for (const Layer layer : {Layer::raw, Layer::rectified}) {
    const auto paths = in_layer(view, layer, rectification::PixelPath{{-9000, 256}, {9000, 256}});
    ASSERT_EQ(paths.size(), 1u);
    EXPECT_GT(paths[0].front().x(), -1);
    EXPECT_LT(paths[0].back().x(), 512);
  }
}

TEST(MarkNear, NearestWithinReachIsFound) {
  report::ViewMarks marks;
  marks.balls = {{"P1", {10, 10}, true, 0.02, Vector2d(0.3, 0.4)}, {"P2", {14, 10}, false}};
  marks.points = {{"T1", {40, 40}, localization::PointSource::target, 0.25},
                  {"start", {60, 60}, localization::PointSource::pick, {}, "alone"}};
  EXPECT_EQ(mark_near(marks, {11, 10}, 8)->name, "P1");
  EXPECT_EQ(mark_near(marks, {13, 10}, 8)->name, "P2");
  EXPECT_FALSE(mark_near(marks, {25, 25}, 8));
  const auto tip = [&](const Vector2d& at) { return mark_near(marks, at, 5)->tip.toStdString(); };
  EXPECT_THAT(tip({10, 10}), testing::AllOf(testing::HasSubstr("0.020"), testing::HasSubstr("0.500")));
  EXPECT_THAT(tip({14, 10}), testing::HasSubstr("rejected"));
  EXPECT_THAT(tip({40, 40}),
              testing::AllOf(testing::HasSubstr("0.25 mm"), testing::HasSubstr("check target")));
  EXPECT_THAT(tip({60, 60}), testing::AllOf(testing::HasSubstr("not located"), testing::HasSubstr("alone")));
  EXPECT_EQ(mark_near(marks, {40, 40}, 5)->kind, MarkUnderCursor::Kind::point);
}

}  // namespace
}  // namespace helicarm::gui
