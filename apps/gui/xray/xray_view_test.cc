// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/xray_view_test.h"

#include <QSignalSpy>

#include "gui/xray/readout.h"

namespace helicarm::gui {
namespace {

TEST_F(XrayViewTest, MarksAreDrawnWhereAClickGivesTheirPixel) {
  pipeline::Result bare;
  xray::XrayImage dot;
  dot.pixels = image::Image<float>(33, 33, 1);
  dot.pixels(20, 9) = 100;
  bare.views.push_back({"dot", std::make_shared<const xray::XrayImage>(std::move(dot)), {}, {}, {}});
  view.show_view(std::make_shared<const pipeline::Result>(std::move(bare)), 0);
  settle();
  view.set_window({1, 100});
  view.clearFocus();
  const QImage image = view.grab().toImage().convertToFormat(QImage::Format_Grayscale8);
  const QPointF expected = *view.place_of({20, 9});
  QPointF sum;
  double weight = 0;
  for (int y = -40; y <= 40; ++y)
    for (int x = -40; x <= 40; ++x) {
      const QPoint at = expected.toPoint() + QPoint(x, y);
      const double grey = image.pixelColor(at).red();
      sum += grey * (QPointF(at) + QPointF(0.5, 0.5));
      weight += grey;
    }
  EXPECT_NEAR(sum.x() / weight, expected.x(), 0.3);
  EXPECT_NEAR(sum.y() / weight, expected.y(), 0.3);
}

TEST_F(XrayViewTest, MeasuresAreDrawnInEveryLayer) {
  EvaluatedMeasure measure;
  measure.strokes = {{{{200, 260}, {320, 260}}}};
  for (const Layer layer : {Layer::rectified, Layer::raw}) {
    view.set_layer(layer);
    settle();
    view.set_measures({});
    const QImage before = view.grab().toImage();
    view.set_measures({measure});
    EXPECT_NE(view.grab().toImage(), before);
  }
  view.clear("gone");
  view.show_view(simulated_result(), 0);
  settle();
  const QImage fresh = view.grab().toImage();
  view.set_measures({});
  EXPECT_EQ(view.grab().toImage(), fresh);
}

/// The case after a refused labelling of the second view.
std::shared_ptr<const pipeline::Result> refused_result() {
  auto refused = std::make_shared<pipeline::Result>(*simulated_result());
  pipeline::ViewResult& view = refused->views[1];
  for (const fiducials::Fiducial& ball : view.found->fiducials)
    view.guessed.push_back({ball.label, ball.uv_raw, ball.uv, 2.5});
  view.found.reset();
  view.calibrated.reset();
  refused->points.clear();
  refused->tunnel_ends.clear();
  refused->failure =
      Failure{Reason::ambiguous_labels, "two labellings fit alike", view.name, {{"margin", 1.25}}};
  return refused;
}

TEST_F(XrayViewTest, RefusalShowsReasonCandidatesAndDetails) {
  view.show_view(refused_result(), 1);
  settle();
  EXPECT_EQ(view.refusal(), "Refused: two labellings fit alike (ambiguous_labels)");
  EXPECT_TRUE(view.accessibleDescription().contains("12 of them with a guessed label"))
      << view.accessibleDescription().toStdString();
  const QImage reason = view.grab().toImage();
  key(Qt::Key_D);
  EXPECT_TRUE(view.refusal().contains("Likely causes"));
  EXPECT_TRUE(view.refusal().contains("margin = 1.25"));
  EXPECT_NE(view.grab().toImage(), reason);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {320, 560});  // in the box
  EXPECT_FALSE(view.refusal().contains("Likely causes"));
  const QString place = qEnvironmentVariable("HELICARM_SCREENSHOTS");
  if (!place.isEmpty()) view.grab().save(place + "/refused.png");
}

TEST_F(XrayViewTest, RefusalOfAnotherViewAndWhilePickingIsNotInTheWay) {
  view.show_view(refused_result(), 0);
  settle();
  EXPECT_EQ(view.refusal(), "");
  view.show_view(refused_result(), 1);
  settle();
  view.set_picking(true);
  QSignalSpy picked(&view, &XrayView::picked);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {320, 560});
  EXPECT_EQ(picked.count(), 1);
}

TEST_F(XrayViewTest, PickThatTheResultShowsIsDrawnOnce) {
  const pipeline::PointResult& point = simulated_result()->points[0];
  const QString name = QString::fromStdString(point.name);
  const QImage by_result = view.grab().toImage();
  view.set_picks({{name, point.seen[0]->uv_raw + Eigen::Vector2d(2, 0)}});
  EXPECT_EQ(view.grab().toImage(), by_result);
  view.set_picks({{name, point.seen[0]->uv_raw + Eigen::Vector2d(60, 0)}});
  const QImage moved = view.grab().toImage();
  EXPECT_NE(moved, by_result);
  view.set_mark_groups(all_marks & ~MarkGroups(MarkGroup::points));
  view.set_picks({});
  EXPECT_NE(view.grab().toImage(), by_result);
  view.set_mark_groups(all_marks);
  EXPECT_EQ(view.grab().toImage(), by_result);
}

TEST_F(XrayViewTest, ReadoutGivesGreyValueAndPlace) {
  const fiducials::Fiducial& ball = shown().found->fiducials[3];
  const QString words = readout_of(*simulated_result(), 0, ball.uv_raw);
  const int u = int(std::lround(ball.uv_raw.x())), v = int(std::lround(ball.uv_raw.y()));
  EXPECT_TRUE(words.contains(QString("grey %1").arg(double(shown().xray_image->pixels(u, v)), 0, 'g', 6)))
      << words.toStdString();
  EXPECT_TRUE(words.contains("mm at the calibrator")) << words.toStdString();
  EXPECT_EQ(readout_of(*simulated_result(), 0, {-5, 3}), "");
  pipeline::Result bare;
  bare.views.push_back({"AP", shown().xray_image, {}, {}, {}});
  EXPECT_FALSE(readout_of(bare, 0, ball.uv_raw).contains("mm"));
}

TEST_F(XrayViewTest, ClearRemovesEverything) {
  view.clear("No image yet: acquire AP");
  EXPECT_FALSE(view.raw_at({300, 300}));
  EXPECT_FALSE(view.window());
  view.set_picking(true);
  QSignalSpy spy(&view, &XrayView::picked);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  for (int which : {Qt::Key_H, Qt::Key_L, Qt::Key_0, Qt::Key_W, Qt::Key_Plus, Qt::Key_Return}) key(which);
  view.set_tool(guidance::ImageLine{{1, 2}, {3, 4}}, "note");
  view.grab();
  EXPECT_EQ(spy.count(), 0);
}

TEST_F(XrayViewTest, OldRequestIsDroppedAndAClearedViewStaysClear) {
  for (int i = 0; i < 7; ++i) key(Qt::Key_L);
  view.show_view(simulated_result(), 1);
  settle();
  EXPECT_EQ(view.accessibleName(), "X-ray image LAT");
  view.set_layer(Layer::raw);
  view.set_layer(Layer::inpainted);
  view.clear("gone");
  QTest::qWait(300);
  EXPECT_FALSE(view.raw_at({300, 300}));
}

TEST_F(XrayViewTest, MayBeDeletedWhileALayerIsComputed) {
  for (int i = 0; i < 10; ++i) {
    auto other = std::make_unique<XrayView>();
    other->show_view(simulated_result(), 0);
    QTest::qWait(3 * i);
  }
}

TEST_F(XrayViewTest, MissingViewShowsTheNextAction) {
  pipeline::Result empty;
  empty.views.push_back({"AP", {}, {}, {}, {}});
  const auto result = std::make_shared<const pipeline::Result>(std::move(empty));
  view.show_view(result, 0);
  EXPECT_EQ(view.accessibleDescription(), "No image yet: acquire AP");
  view.show_view(result, 5);
  view.show_view(nullptr, 0);
  EXPECT_FALSE(view.is_computing());
}

}  // namespace
}  // namespace helicarm::gui

int main(int count, char** arguments) {
  qputenv("QT_QPA_PLATFORM", "offscreen");
  QApplication application(count, arguments);
  testing::InitGoogleTest(&count, arguments);
  return RUN_ALL_TESTS();
}
