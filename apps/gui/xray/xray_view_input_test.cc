// SPDX-License-Identifier: Apache-2.0
#include <QSignalSpy>
#include <random>

#include "gui/xray/xray_view_test.h"

namespace helicarm::gui {
namespace {

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

TEST_F(XrayViewTest, AClickThatPicksNothingIsTold) {
  QSignalSpy told(&view, &XrayView::not_picked);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  EXPECT_EQ(told.count(), 1);
  drag({300, 300}, {350, 280}, Qt::LeftButton);
  EXPECT_EQ(told.count(), 1);
  view.set_picking(true);
  QTest::mouseClick(&view, Qt::LeftButton, {}, {300, 300});
  EXPECT_EQ(told.count(), 1);
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
