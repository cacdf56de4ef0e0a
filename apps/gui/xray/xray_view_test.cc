// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/xray_view.h"

#include <QApplication>
#include <QSignalSpy>
#include <QTest>
#include <random>

#include <gtest/gtest.h>

#include "gui/xray/readout.h"
#include "gui/xray/simulated_result_test.h"

namespace helicarm::gui {
namespace {

class XrayViewTest : public testing::Test {
 protected:
  void SetUp() override {
    view.resize(640, 640);
    view.show();
    view.show_view(simulated_result(), 0);
    settle();
  }
  void settle() {
    for (int i = 0; i < 500 && view.is_computing(); ++i) QTest::qWait(10);
    ASSERT_FALSE(view.is_computing());
  }
  const pipeline::ViewResult& shown() { return simulated_result()->views[0]; }
  void key(int which, Qt::KeyboardModifiers with = Qt::NoModifier) {
    QTest::keyClick(&view, static_cast<Qt::Key>(which), with);
  }
  void drag(const QPoint& from, const QPoint& to, Qt::MouseButton button) {
    QTest::mousePress(&view, button, {}, from);
    for (const QPoint& at : {from + (to - from) / 2, to}) {
      QMouseEvent move(QEvent::MouseMove, at, view.mapToGlobal(QPointF(at)), Qt::NoButton, button, {});
      QApplication::sendEvent(&view, &move);
    }
    QTest::mouseRelease(&view, button, {}, to);
  }
  void wheel(const QPoint& at, int angle) {
    QWheelEvent event(at, view.mapToGlobal(QPointF(at)), {}, {0, angle}, {}, {}, Qt::NoScrollPhase, false);
    QApplication::sendEvent(&view, &event);
  }

  XrayView view;
};

TEST_F(XrayViewTest, ClickGivesARawPixelInEveryLayerAtAnyZoom) {
  const fiducials::Fiducial& ball = shown().found->fiducials[3];
  const QPointF raw(ball.uv_raw.x(), ball.uv_raw.y());
  view.set_picking(true);
  for (const Layer layer : {Layer::raw, Layer::rectified, Layer::inpainted}) {
    view.set_layer(layer);
    settle();
    key(Qt::Key_0);
    for (const double screen_px : {1.3, 2.6, 9.0}) {
      QSignalSpy spy(&view, &XrayView::picked);
      const QPointF at = *view.place_of(raw);
      QTest::mouseClick(&view, Qt::LeftButton, {}, QPoint(int(std::floor(at.x())), int(std::floor(at.y()))));
      ASSERT_EQ(spy.count(), 1);
      const QPointF off = spy[0][0].toPointF() - raw;
      EXPECT_LT(std::hypot(off.x(), off.y()), 0.75 / screen_px) << int(layer);
      wheel(at.toPoint(), screen_px < 2 ? 500 : 900);
    }
  }
}

TEST_F(XrayViewTest, TheHandleOfAModelIsDraggedByItsMiddleAndByItsRing) {
  const Eigen::Vector2d centre(shown().xray_image->pixels.width() / 2.0,
                               shown().xray_image->pixels.height() / 2.0);
  view.set_handle(ModelHandle{centre, Qt::yellow});
  const Eigen::Vector2d raw = shown().rectification->map.raw_from_rectified(centre);
  const QPoint middle = view.place_of({raw.x(), raw.y()})->toPoint();
  std::vector<std::pair<HandlePart, bool>> dragged;
  QPointF way;
  QObject::connect(&view, &XrayView::handle_dragged, &view,
                   [&](HandlePart part, const QPointF& from, const QPointF& to, bool continues) {
                     dragged.emplace_back(part, continues);
                     way += to - from;
                   });
  view.set_picking(true);
  QSignalSpy picked(&view, &XrayView::picked);
  drag(middle, middle + QPoint(40, 0), Qt::LeftButton);
  EXPECT_EQ(dragged,
            (std::vector{std::pair(HandlePart::middle, false), std::pair(HandlePart::middle, true)}));
  EXPECT_NEAR(way.x(), 40 / view.zoom_factor(), 3);
  EXPECT_NEAR(way.y(), 0, 1);
  dragged.clear();
  drag(middle + QPoint(int(handle_radius), 0), middle + QPoint(0, int(handle_radius)), Qt::LeftButton);
  ASSERT_EQ(dragged.size(), 2u);
  EXPECT_EQ(dragged[0], std::pair(HandlePart::ring, false));
  dragged.clear();
  drag(middle + QPoint(90, 0), middle + QPoint(120, 0), Qt::LeftButton);
  EXPECT_TRUE(dragged.empty());
  EXPECT_EQ(picked.count(), 0);
  view.set_handle({});
  drag(middle, middle + QPoint(40, 0), Qt::LeftButton);
  EXPECT_TRUE(dragged.empty());
}

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

TEST_F(XrayViewTest, DragIsNotAPickAndAClickOnlyWhilePicking) {
  QSignalSpy spy(&view, &XrayView::picked);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  view.set_picking(true);
  drag({300, 300}, {360, 320}, Qt::LeftButton);
  QTest::mouseClick(&view, Qt::RightButton, {}, {300, 300});
  EXPECT_EQ(spy.count(), 0);
}

TEST_F(XrayViewTest, ClicksMeasureInsteadOfPickingWhileATool) {
  QSignalSpy picked(&view, &XrayView::picked), measured(&view, &XrayView::measured),
      finished(&view, &XrayView::measure_finished);
  view.set_picking(true);
  view.set_measuring(true);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  key(Qt::Key_Return);
  EXPECT_EQ(measured.count(), 1);
  EXPECT_EQ(finished.count(), 1);
  EXPECT_EQ(picked.count(), 0);
  view.set_measuring(false);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  EXPECT_EQ(picked.count(), 1);
}

TEST_F(XrayViewTest, ClickOfAMeasureIsDraggedWhileMeasuring) {
  EvaluatedMeasure measure;
  measure.number = 3;
  measure.points = {{200, 260}, {320, 260}};
  view.set_measures({measure});
  const QPoint from = ImageFrame::fitted(QSizeF(512, 512), view.size()).to_widget({320, 260}).toPoint();
  QSignalSpy moved(&view, &XrayView::measure_click_moved), measured(&view, &XrayView::measured);
  drag(from, from + QPoint(40, 0), Qt::LeftButton);
  EXPECT_EQ(moved.count(), 0);
  view.fit();
  view.set_measuring(true);
  drag(from, from + QPoint(40, 0), Qt::LeftButton);
  ASSERT_GT(moved.count(), 0);
  EXPECT_EQ(moved.back()[0].toInt(), 3);
  EXPECT_EQ(moved.back()[1].toInt(), 1);
  const QPointF off = *view.place_of(moved.back()[2].toPointF()) - QPointF(from + QPoint(40, 0));
  EXPECT_LT(std::hypot(off.x(), off.y()), 1);
  EXPECT_EQ(measured.count(), 0);
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

TEST_F(XrayViewTest, DraggedMovablePickIsDroppedAtItsNewPixel) {
  const Eigen::Vector2d raw = shown().found->fiducials[3].uv_raw;
  view.set_movable_picks({{"FS", raw}});
  QSignalSpy moved(&view, &XrayView::pick_moved), picked(&view, &XrayView::picked);
  view.set_picking(true);
  const QPoint from = view.place_of({raw.x(), raw.y()})->toPoint();
  drag(from, from + QPoint(40, 20), Qt::LeftButton);
  ASSERT_EQ(moved.count(), 1);
  EXPECT_EQ(moved[0][0].toString(), "FS");
  const QPointF off = *view.place_of(moved[0][1].toPointF()) - QPointF(from + QPoint(40, 20));
  EXPECT_LT(std::hypot(off.x(), off.y()), 1);
  EXPECT_EQ(picked.count(), 0);
  EXPECT_EQ(view.place_of({raw.x(), raw.y()})->toPoint(), from);  // the image has not moved
}

TEST_F(XrayViewTest, DragFarFromAMovablePickPans) {
  const Eigen::Vector2d raw = shown().found->fiducials[3].uv_raw;
  view.set_movable_picks({{"FS", raw}});
  QSignalSpy moved(&view, &XrayView::pick_moved);
  for (int i = 0; i < 3; ++i) key(Qt::Key_Plus);
  const QPoint from = view.place_of({raw.x(), raw.y()})->toPoint();
  drag(from + QPoint(30, 0), from + QPoint(50, 10), Qt::LeftButton);
  EXPECT_EQ(moved.count(), 0);
  EXPECT_NE(view.place_of({raw.x(), raw.y()})->toPoint(), from);
}

TEST_F(XrayViewTest, DoubleClickWhilePickingIsOnePick) {
  QSignalSpy spy(&view, &XrayView::picked);
  view.set_picking(true);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  QTest::mouseDClick(&view, Qt::LeftButton, {}, {300, 300});
  EXPECT_EQ(spy.count(), 1);
}

TEST_F(XrayViewTest, LeftDragPansAndDoubleClickFits) {
  const QPointF before = *view.place_of({256, 256});
  drag({300, 300}, {350, 280}, Qt::LeftButton);
  const QPointF moved = *view.place_of({256, 256}) - before;
  EXPECT_NEAR(moved.x(), 50, 1e-6);
  EXPECT_NEAR(moved.y(), -20, 1e-6);
  QTest::mouseDClick(&view, Qt::LeftButton, {}, {300, 300});
  EXPECT_LT((*view.place_of({256, 256}) - before).manhattanLength(), 1e-6);
}

TEST_F(XrayViewTest, WheelKeepsThePixelUnderTheCursor) {
  const QPointF raw = *view.raw_at({200, 410});
  wheel({200, 410}, 360);
  EXPECT_LT((*view.raw_at({200, 410}) - raw).manhattanLength(), 1e-6);
}

TEST_F(XrayViewTest, RightDragChangesTheWindowAndWRestoresIt) {
  const image::GreyWindow usual = *view.window();
  drag({300, 300}, {400, 340}, Qt::RightButton);
  EXPECT_GT(view.window()->high - view.window()->low, usual.high - usual.low);
  key(Qt::Key_W);
  EXPECT_EQ(view.window()->high, usual.high);
}

TEST_F(XrayViewTest, KeysZoomPanAndCycleTheLayers) {
  QSignalSpy layers(&view, &XrayView::layer_changed);
  key(Qt::Key_L);
  key(Qt::Key_L);
  EXPECT_EQ(view.layer(), Layer::raw);
  EXPECT_EQ(layers.count(), 2);
  settle();
  const QPointF before = *view.place_of({100, 100});
  key(Qt::Key_Plus);
  key(Qt::Key_Right);
  EXPECT_GT((*view.place_of({100, 100}) - before).manhattanLength(), 10);
  key(Qt::Key_0);
  EXPECT_LT((*view.place_of({100, 100}) - before).manhattanLength(), 1e-6);
}

TEST_F(XrayViewTest, PicksByKeyboard) {
  view.set_picking(true);
  QSignalSpy spy(&view, &XrayView::picked);
  key(Qt::Key_Return);
  EXPECT_EQ(spy.count(), 0);
  for (int i = 0; i < 3; ++i) key(Qt::Key_Right, Qt::ShiftModifier);
  key(Qt::Key_Up, Qt::ShiftModifier | Qt::ControlModifier);
  const QPointF expected = *view.raw_at({320 + 30, 320 - 1});
  key(Qt::Key_Return);
  ASSERT_EQ(spy.count(), 1);
  EXPECT_LT((spy[0][0].toPointF() - expected).manhattanLength(), 1e-6);
  for (int i = 0; i < 200; ++i) key(Qt::Key_Left, Qt::ShiftModifier);
  key(Qt::Key_Escape);
  key(Qt::Key_Return);
  EXPECT_LE(spy.count(), 1);
}

TEST_F(XrayViewTest, TooltipNamesTheFiducial) {
  std::vector<std::string> names;
  QObject::connect(&view, &XrayView::hovered, [&](const std::optional<MarkUnderCursor>& mark) {
    names.push_back(mark ? mark->name.toStdString() : "");
  });
  const auto hover = [&](const QPointF& at) {
    QMouseEvent move(QEvent::MouseMove, at, view.mapToGlobal(at), Qt::NoButton, Qt::NoButton, {});
    QApplication::sendEvent(&view, &move);
  };
  for (const fiducials::Fiducial& ball : shown().found->fiducials) {
    if (ball.status != fiducials::FiducialStatus::used) continue;
    hover({2, 2});
    names.clear();
    hover(*view.place_of({ball.uv_raw.x(), ball.uv_raw.y()}));
    EXPECT_EQ(names, std::vector{ball.label});
  }
  view.clear("gone");
  EXPECT_EQ(names.back(), "");
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

TEST_F(XrayViewTest, RandomInputDoesNotCrash) {
  std::mt19937 random(5);
  const auto below = [&](int n) { return int(random() % unsigned(n)); };
  const int keys[] = {Qt::Key_H,    Qt::Key_L,      Qt::Key_M,      Qt::Key_W,     Qt::Key_0,
                      Qt::Key_Plus, Qt::Key_Minus,  Qt::Key_Left,   Qt::Key_Right, Qt::Key_Up,
                      Qt::Key_Down, Qt::Key_Return, Qt::Key_Escape, Qt::Key_A};
  const Qt::MouseButton buttons[] = {Qt::LeftButton, Qt::RightButton, Qt::MiddleButton};
  const Qt::KeyboardModifier with[] = {Qt::NoModifier, Qt::ShiftModifier, Qt::ControlModifier};
  for (int i = 0; i < 500; ++i) {
    const QPoint at(below(700) - 30, below(700) - 30), to(below(700) - 30, below(700) - 30);
    switch (below(9)) {
      case 0:
        drag(at, to, buttons[below(3)]);
        break;
      case 1:
        QTest::mouseClick(&view, buttons[below(3)], {}, at);
        break;
      case 2:
        QTest::mouseDClick(&view, buttons[below(3)], {}, at);
        break;
      case 3:
        wheel(at, below(2000) - 1000);
        break;
      case 4:
        view.resize(1 + below(900), 1 + below(900));
        break;
      case 5:
        view.set_picking(below(2));
        break;
      case 6:
        view.set_tool(guidance::ImageLine{{double(at.x()), 9}, {double(to.x()), 1e5}}, "tip");
        break;
      default:
        key(keys[below(int(std::size(keys)))], with[below(3)]);
    }
    if (i % 50 == 20) view.show_view(simulated_result(), std::size_t(below(3)));
    if (i % 5 == 0) QApplication::processEvents();
    if (i % 25 == 0) view.grab();
  }
}

}  // namespace
}  // namespace helicarm::gui

int main(int count, char** arguments) {
  qputenv("QT_QPA_PLATFORM", "offscreen");
  QApplication application(count, arguments);
  testing::InitGoogleTest(&count, arguments);
  return RUN_ALL_TESTS();
}
