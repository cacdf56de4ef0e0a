// SPDX-License-Identifier: Apache-2.0
// Needs a display with OpenGL: CTest runs it under Xvfb. HELICARM_SCREENSHOTS=folder saves the images.
#include "gui/scene/scene_view.h"

#include <QApplication>
#include <QMouseEvent>
#include <QTest>
#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "gui/scene/simulated_result_test.h"
#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::gui {
namespace {

class ShownScene : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(view_.obstacle());
    view_.resize(420, 420);
    view_.show();
    ASSERT_TRUE(QTest::qWaitForWindowExposed(&view_));
    view_.show_result(simulated().result, simulated().the_case.calibrator);
  }

  QImage acquired_view(const char* name) {
    const QImage image = view_.grab().toImage().convertToFormat(QImage::Format_RGB32);
    if (qEnvironmentVariableIsSet("HELICARM_SCREENSHOTS"))
      image.save(qEnvironmentVariable("HELICARM_SCREENSHOTS") + "/" + name + ".png");
    return image;
  }

  static LiveScene live() {
    LiveScene live;
    const auto& points = simulated().truth.navigation->points;
    const Eigen::Vector3d end = points[1].in_calibrator, start = points[0].in_calibrator;
    const Eigen::Matrix3d turn = geometry::rotation_between(Eigen::Vector3d::UnitZ(), end - start);
    live.calibrator_from_tip = geometry::RigidTransform{turn, start};
    live.calibrator_from_base = geometry::RigidTransform{
        (Eigen::Matrix3d() << 0, 1, 0, -1, 0, 0, 0, 0, 1).finished(), {60, 520, -160}};
    const geometry::RigidTransform calibrator_from_flange =
        *live.calibrator_from_tip * geometry::RigidTransform{Eigen::Matrix3d::Identity(), {0, 0, -150}};
    const auto ways =
        robot::inverse(robot::ur5(), live.calibrator_from_base->inverse() * calibrator_from_flange);
    live.joints =
        ways.empty() ? robot::Joints((robot::Joints() << 0, -1.2, 1.5, -1, 0.5, 0).finished()) : ways.front();
    const guidance::Poses& poses = simulated().the_case.views[0].poses;
    for (const auto& [bone, pose] : poses.tracker_from_bone)
      live.calibrator_from_bone_marker.emplace(bone, *guidance::calibrator_from(bone, poses));
    for (int i = 10; i >= 0; --i) live.path.push_back(start - 12 * i * turn.col(2));
    return live;
  }

  static BoneMeshes bones() {
    return simulation::moved(simulation::bone_meshes(6), *simulated().truth.calibrator_from_knee);
  }

  static localization::TreVolume tre() {
    const pipeline::Result& result = *simulated().result;
    calibration::Calibration calibration{{}, pipeline::joint_covariance(result)};
    for (const pipeline::ViewResult& view : result.views) calibration.views.push_back(*view.calibrated);
    localization::TreVolume volume = localization::predict_tre(calibration, {0, 0, 40}, 100, 10, 0.5, 0);
    volume.rms_mm[std::size_t((10 * 21 + 3) * 21 + 4)] = std::nan("");
    return volume;
  }

  SceneView view_;
};

std::size_t colours_in(const QImage& image) {
  std::set<QRgb> colours;
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) colours.insert(image.pixel(x, y));
  return colours.size();
}

int pixels_apart(const QImage& a, const QImage& b) {
  int apart = 0;
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x) apart += a.pixel(x, y) != b.pixel(x, y);
  return apart;
}

TEST_F(ShownScene, EachPresetGivesAnotherImage) {
  const QImage overview = acquired_view("overview");
  EXPECT_GT(colours_in(overview), 50u);
  view_.set_preset(SceneView::Preset::ap);
  const QImage ap = acquired_view("ap");
  view_.set_preset(SceneView::Preset::lateral);
  const QImage lateral = acquired_view("lateral");
  EXPECT_GT(pixels_apart(overview, ap), 5000);
  EXPECT_GT(pixels_apart(ap, lateral), 5000);
  view_.set_preset(SceneView::Preset::free);
  EXPECT_EQ(pixels_apart(acquired_view("overview"), overview), 0);
}

TEST_F(ShownScene, ToolRobotAndBonesMove) {
  view_.show_bones(bones());
  LiveScene now = live();
  view_.set_preset(SceneView::Preset::lateral);
  const QImage bare = acquired_view("bones_lateral");
  view_.show_live(now);
  const QImage with_tool = acquired_view("tool_lateral");
  EXPECT_GT(pixels_apart(bare, with_tool), 200);
  now.calibrator_from_tip->translation.x() += 8;
  view_.show_live(now);
  EXPECT_GT(pixels_apart(acquired_view("tool_moved"), with_tool), 100);
  view_.set_preset(SceneView::Preset::free);
  const QImage still = acquired_view("robot");
  (*now.joints)[0] += 0.2;
  view_.show_live(now);
  const QImage turned = acquired_view("robot_turned");
  EXPECT_GT(pixels_apart(still, turned), 100);
  now.bones_moved["tibia"] = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {25, 0, 0}};
  view_.show_live(now);
  EXPECT_GT(pixels_apart(acquired_view("tibia_moved"), turned), 100);
  view_.show_live({});
  view_.show_bones({});
  view_.show_result(nullptr, simulated().the_case.calibrator);
  EXPECT_LT(colours_in(acquired_view("empty")), 150u);  // the triad's letters
}

TEST_F(ShownScene, TheRobotComesIntoTheView) {
  const LiveScene now = live();
  view_.show_live(now);
  view_.look_near();
  const QImage near = acquired_view("robot_near");
  view_.look_at_robot();
  const QImage whole = acquired_view("robot_whole");
  EXPECT_GT(pixels_apart(near, whole), 5000);
  view_.show_live({});
  EXPECT_GT(pixels_apart(acquired_view("robot_gone"), whole), 2000);
}

TEST_F(ShownScene, PartsAreDrawnAsOpaqueAsWished) {
  view_.show_bones(bones());
  view_.set_preset(SceneView::Preset::lateral);
  const QImage glass = acquired_view("bones_glass");
  int changes = 0;
  QObject::connect(&view_, &SceneView::objects_changed, &view_, [&] { ++changes; });
  SceneOpacity opacity;
  opacity.bones = 1;
  view_.set_opacity(opacity);
  EXPECT_EQ(changes, 1);
  EXPECT_GT(pixels_apart(acquired_view("bones_opaque"), glass), 2000);
  view_.set_opacity({});
  EXPECT_EQ(pixels_apart(acquired_view("bones_glass"), glass), 0);
}

TEST_F(ShownScene, AHandleIsDraggedAcrossTheLineOfSightAndTurnedAboutIt) {
  view_.set_preset(SceneView::Preset::ap);
  const Eigen::Vector3d place = phantom::middle_of(simulated().the_case.calibrator);
  view_.set_handle(SceneView::Handle{place, {250, 204, 21}});
  ASSERT_TRUE(view_.handle_place());
  const QPoint middle = view_.handle_place()->toPoint();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero(), turn = Eigen::Vector3d::Zero();
  QObject::connect(&view_, &SceneView::handle_shifted, &view_,
                   [&](const Eigen::Vector3d& by, bool) { shift += by; });
  QObject::connect(&view_, &SceneView::handle_turned, &view_,
                   [&](const Eigen::Vector3d& by, bool) { turn += by; });
  const auto drag = [&](const QPoint& from, const QPoint& to) {
    QTest::mousePress(&view_, Qt::LeftButton, {}, from);
    QMouseEvent move(QEvent::MouseMove, to, view_.mapToGlobal(QPointF(to)), Qt::NoButton, Qt::LeftButton, {});
    QApplication::sendEvent(&view_, &move);
    QTest::mouseRelease(&view_, Qt::LeftButton, {}, to);
  };
  drag(middle, middle + QPoint(30, 0));
  EXPECT_GT(shift.norm(), 1);
  view_.set_handle(SceneView::Handle{place + shift, {250, 204, 21}});
  EXPECT_NEAR(view_.handle_place()->x() - middle.x(), 30, 1);
  EXPECT_NEAR(view_.handle_place()->y() - middle.y(), 0, 1);
  EXPECT_TRUE(turn.isZero());
  view_.set_handle(SceneView::Handle{place, {250, 204, 21}});
  drag(middle + QPoint(int(handle_radius), 0), middle + QPoint(0, int(handle_radius)));
  EXPECT_NEAR(turn.norm(), 0.5 * EIGEN_PI, 0.05);
}

TEST_F(ShownScene, ModelsStandAtTheirPoses) {
  view_.set_preset(SceneView::Preset::ap);
  const QImage bare = acquired_view("models_none");
  auto model = std::make_shared<registration::Model>();
  model->surface.emplace();
  model->surface->mesh = simulation::bone_meshes(6).femur;
  ModelShape shape;
  shape.name = "femur";
  shape.colour = {250, 204, 21};
  shape.model = model;
  shape.calibrator_from_model = *simulated().truth.calibrator_from_knee;
  view_.show_models({shape});
  QImage registered;
  ASSERT_TRUE(QTest::qWaitFor([&] {
    registered = acquired_view("models");
    return pixels_apart(registered, bare) > 5000;
  }));
  shape.calibrator_from_model.translation.x() += 8;
  shape.state = ModelShape::State::by_hand;
  view_.show_models({shape});
  const QImage moved = acquired_view("models_by_hand");
  EXPECT_GT(pixels_apart(moved, registered), 1000);
  EXPECT_GT(pixels_apart(moved, bare), 5000);
  shape.state = ModelShape::State::refused;
  view_.show_models({shape});
  EXPECT_GT(pixels_apart(acquired_view("models_refused"), moved), 1000);
  LiveScene live;
  live.bones_moved["femur"] = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {0, 0, 20}};
  shape.moves_with = "femur";
  view_.show_models({shape});
  const QImage still = acquired_view("models_still");
  view_.show_live(live);
  EXPECT_GT(pixels_apart(acquired_view("models_with_bone"), still), 1000);
  view_.show_live({});
  view_.show_models({});
  EXPECT_EQ(pixels_apart(acquired_view("models_gone"), bare), 0);
}

TEST_F(ShownScene, TreSliceLiesInTheImage) {
  view_.show_bones(bones());
  view_.set_preset(SceneView::Preset::ap);
  const QImage without = acquired_view("bones_ap");
  view_.show_tre(tre(), SliceAxis::z, 40);
  const QImage with = acquired_view("tre_ap");
  EXPECT_GT(pixels_apart(without, with), 10000);
  view_.set_preset(SceneView::Preset::free);
  view_.show_tre(tre(), SliceAxis::x, 0);
  acquired_view("tre_overview");
  view_.set_preset(SceneView::Preset::ap);
  view_.show_tre({}, SliceAxis::z, 40);
  EXPECT_EQ(pixels_apart(acquired_view("tre_gone"), without), 0);
}

TEST_F(ShownScene, SurvivesTwoHundredRandomEvents) {
  view_.show_bones(bones());
  view_.show_live(live());
  RandomStream random(1, 1);
  const auto below = [&](int n) { return int(random.uniform() * n) % n; };
  const Qt::MouseButton buttons[]{Qt::LeftButton, Qt::RightButton, Qt::MiddleButton};
  const Qt::Key keys[]{Qt::Key_1,    Qt::Key_2,  Qt::Key_3,    Qt::Key_R,     Qt::Key_Left, Qt::Key_Right,
                       Qt::Key_Down, Qt::Key_Up, Qt::Key_Plus, Qt::Key_Minus, Qt::Key_X};
  for (int i = 0; i < 200; ++i) {
    const QPointF at(below(420), below(420));
    if (below(3) == 0) {
      QTest::keyClick(&view_, keys[below(11)]);
    } else if (below(4) == 0) {
      QWheelEvent wheel(at, at, {}, {0, below(2) ? 120 : -120}, Qt::NoButton, Qt::NoModifier,
                        Qt::NoScrollPhase, false);
      QApplication::sendEvent(&view_, &wheel);
    } else {
      const Qt::MouseButton button = buttons[below(3)];
      QTest::mousePress(&view_, button, Qt::NoModifier, at.toPoint());
      QMouseEvent way(QEvent::MouseMove, QPointF(below(420), below(420)), QPointF(), button, button, {});
      QApplication::sendEvent(&view_, &way);
      QTest::mouseRelease(&view_, button);
    }
    if (i % 20 == 0) view_.resize(120 + below(400), 120 + below(400));
    if (i % 50 == 0) view_.hide(), view_.show();
    QApplication::processEvents();
  }
  EXPECT_FALSE(view_.obstacle());
  QTest::keyClick(&view_, Qt::Key_3);
  EXPECT_GT(colours_in(acquired_view("after_events")), 50u);
}

TEST_F(ShownScene, SurvivesAChangeOfWindow) {
  view_.set_preset(SceneView::Preset::ap);
  const QImage before = acquired_view("before_move");
  {
    QWidget window;
    window.resize(420, 420);
    view_.setParent(&window);
    view_.setGeometry(0, 0, 420, 420);
    view_.show();
    window.show();
    ASSERT_TRUE(QTest::qWaitForWindowExposed(&window));
    EXPECT_LT(pixels_apart(acquired_view("after_move"), before), 100);
    view_.setParent(nullptr);
  }
  view_.show();
  ASSERT_TRUE(QTest::qWaitForWindowExposed(&view_));
  EXPECT_GT(colours_in(acquired_view("after_return")), 50u);
}

TEST_F(ShownScene, RedrawIsFast) {
  view_.show_bones(bones());
  view_.show_tre(tre(), SliceAxis::z, 40);
  view_.show_live(live());
  acquired_view("all");
  QTest::keyClick(&view_, Qt::Key_4);
  acquired_view("all_near");
  view_.show_tre({}, SliceAxis::z, 40);
  acquired_view("near");
  view_.show_tre(tre(), SliceAxis::z, 40);
  std::vector<double> times;
  for (int i = 0; i < 100; ++i) {
    LiveScene now = live();
    now.calibrator_from_tip->translation.x() += 0.1 * i;
    view_.show_live(now);
    view_.grab();
    times.push_back(view_.last_render_ms());
  }
  std::ranges::sort(times);
  std::printf("redraw: median %.2f ms, 95 %% %.2f ms\n", times[50], times[95]);
  EXPECT_LT(times[50], 60);  // limit for a busy machine; an idle one needs a tenth
}

TEST(WithoutOpenGL, MessageIsShown) {
  if (QGuiApplication::platformName() != "offscreen") GTEST_SKIP();
  SceneView view;
  ASSERT_TRUE(view.obstacle());
  EXPECT_FALSE(view.obstacle()->isEmpty());
  view.show();
  view.show_result(simulated().result, simulated().the_case.calibrator);
  view.show_live({});
  view.set_preset(SceneView::Preset::ap);
  EXPECT_FALSE(view.grab().isNull());
}

}  // namespace
}  // namespace helicarm::gui

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  QApplication application(argc, argv);
  return RUN_ALL_TESTS();
}
