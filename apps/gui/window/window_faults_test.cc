// SPDX-License-Identifier: Apache-2.0
#include <QMenu>
#include <fstream>
#include <random>

#include "gui/window/window_test.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

TEST_F(Window, SilentTrackerIsShownUntilItSendsAgain) {
  open_rehearsal();
  const auto light = [&](const char* name) { return indicator(name).light; };
  ASSERT_TRUE(wait("tool is green and the robot locked",
                   [&] { return light("tool") == Light::green && light("robot") == Light::amber; }));
  window_->controller().set_fault("silent", true);
  EXPECT_TRUE(wait("femur and tool are red",
                   [&] { return light("femur") == Light::red && light("tool") == Light::red; }));
  window_->controller().set_fault("silent", false);
  EXPECT_TRUE(wait("femur is green", [&] { return light("femur") == Light::green; }));
}

TEST_F(Window, AHiddenMarkerTurnsItsStepYellow) {
  open_rehearsal();
  ASSERT_TRUE(wait("femur is green", [&] { return indicator("femur").light == Light::green; }));
  EXPECT_EQ(card(Phase::acquire).status, StepStatus::waiting);
  window_->controller().set_fault("hide:femur", true);
  EXPECT_TRUE(wait("Acquire warns", [&] { return card(Phase::acquire).status == StepStatus::warning; }));
  EXPECT_THAT(card(Phase::acquire).why.toStdString(), HasSubstr("femur"));
  window_->controller().set_fault("hide:femur", false);
  EXPECT_TRUE(wait("Acquire waits", [&] { return card(Phase::acquire).status == StepStatus::waiting; }));
}

TEST_F(Window, DisconnectedRobotCableInMotionStopsTheRobotAndIsShown) {
  window_->controller().set_virtual_freshness({});
  ASSERT_NO_FATAL_FAILURE(
      stop_in_motion([&] { window_->controller().set_fault("cut_cable", true); }, "no robot state received"));
  ASSERT_TRUE(wait_for_phase(robot::LinkPhase::disconnected));
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::refused);
  EXPECT_EQ(indicator("robot").light, Light::red);
  EXPECT_FALSE(indicator("robot").why.isEmpty());
  for (const char* forbidden : {"register", "planWay", "go", "withdraw"})
    EXPECT_FALSE(window_->findChild<QAbstractButton*>(forbidden)->isEnabled()) << forbidden;
  window_->controller().set_fault("cut_cable", false);
  // Reconnected it is still locked: only a person unlocks it.
  ASSERT_TRUE(wait_for_phase(robot::LinkPhase::idle));
  EXPECT_TRUE(unlock());
}

TEST_F(Window, CArmThatDisconnectsIsShownAndTheNextImageIsAccepted) {
  open_rehearsal();
  EXPECT_EQ(indicator("C-arm").light, Light::off);
  window_->controller().set_fault("breaks_off", true);
  click("shootAP");
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(card(Phase::acquire).status, StepStatus::refused);
  EXPECT_TRUE(wait("the C-arm is red", [&] { return indicator("C-arm").light == Light::red; }));
  EXPECT_EQ(indicator("C-arm").text, "disconnected");
  window_->controller().set_fault("breaks_off", false);
  ASSERT_TRUE(attempt(
      "AP is acquired", [&] { click("shootAP"); },
      [&] { return state().result->views[0].xray_image != nullptr; }));
  EXPECT_EQ(indicator("C-arm").light, Light::green);
  EXPECT_NE(card(Phase::acquire).status, StepStatus::refused);
}

TEST_F(Window, TrackerThatStopsSendingInMotionStopsTheRobot) {
  window_->controller().set_virtual_freshness({});
  ASSERT_NO_FATAL_FAILURE(stop_in_motion([&] { window_->controller().set_fault("silent", true); },
                                         "the newest pose of \"tool\""));
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::refused);
  EXPECT_FALSE(state().hand_eye_rms_mm);
  window_->controller().set_fault("silent", false);
}

TEST_F(Window, StopWorksBesideEveryDialog) {
  const auto stop_beside_settings = [&] {
    QTest::keyClick(window_.get(), Qt::Key_Comma, Qt::ControlModifier);
    ASSERT_TRUE(
        wait("the settings are open", [&] { return window_->findChild<SettingsDialog*>() != nullptr; }));
    auto* stop = find("stop");
    // Through the screen's input path, where a modal dialog would intercept.
    QTest::mouseClick(window_->windowHandle(), Qt::LeftButton, Qt::NoModifier,
                      stop->mapTo(window_.get(), stop->rect().center()));
    wait_idle();
    window_->findChild<SettingsDialog*>()->close();
  };
  stop_in_motion(stop_beside_settings, "stopped by the user");
}

TEST_F(Window, CancelEndsTheWaitForAnImage) {
  open_rehearsal();
  auto* cancel = find("cancel");
  EXPECT_FALSE(cancel->isVisible());
  click("shootAP");
  ASSERT_TRUE(cancel->isVisible());
  QTest::mouseClick(cancel, Qt::LeftButton);
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(cancel->isVisible());
}

TEST_F(Window, RefusedCalibrationIsShownWithItsReasonAndNoNextStep) {
  simulation::SimulationOptions options;
  options.size = 512;
  auto simulated = simulation::simulate_case(options).value();
  for (auto& pixel : simulated.views[1].pixels.pixels()) pixel = 2000;
  ASSERT_TRUE(simulation::write_case(folder_ / "blank", simulated));
  drop(*window_, {folder_ / "blank"});
  ASSERT_TRUE(wait("the case is read", [&] { return state().source == Source::files && !state().busy; }));
  EXPECT_EQ(card(Phase::rectify).status, StepStatus::refused);
  EXPECT_THAT(card(Phase::rectify).why.toStdString(), HasSubstr("blank_image"));
  EXPECT_FALSE(state().measured);
  window_->controller().export_to(folder_ / "export");
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(fs::exists(folder_ / "export"));
}

TEST_F(Window, InvalidDroppedFilesAreRefusedByName) {
  std::ofstream(folder_ / "a.dcm") << "not an image";
  std::ofstream(folder_ / "b.dcm") << "not an image either";
  for (const auto& paths : {std::vector<fs::path>{folder_ / "a.dcm", folder_ / "b.dcm"},
                            {folder_ / "a.dcm"},
                            {folder_ / "gone"},
                            {folder_}}) {
    drop(*window_, paths);
    ASSERT_TRUE(wait_idle());
    EXPECT_EQ(card(Phase::acquire).status, StepStatus::refused);
    EXPECT_FALSE(card(Phase::acquire).why.isEmpty());
  }
}

TEST_F(Window, AMissingCaseIsNamedOnThePageThatWouldAskForImages) {
  drop(*window_, {folder_ / "gone"});
  ASSERT_TRUE(wait_idle());
  EXPECT_THAT(find<QLabel>("notOpened")->text().toStdString(), HasSubstr((folder_ / "gone").string()));
  EXPECT_TRUE(find<QLabel>("notOpened")->isVisible());
  EXPECT_FALSE(find<QLabel>("lead")->isVisible());
  screenshot("not-opened");
}

TEST_F(Window, ThousandRandomClicksAndKeysDoNotFreezeTheWindow) {
  open_rehearsal();
  std::minstd_rand random(7);
  const auto below = [&](int limit) { return int(random() % std::minstd_rand::result_type(limit)); };
  const std::array keys{Qt::Key_Tab, Qt::Key_Return, Qt::Key_Space, Qt::Key_L,    Qt::Key_M, Qt::Key_Plus,
                        Qt::Key_0,   Qt::Key_Up,     Qt::Key_1,     Qt::Key_2,    Qt::Key_R, Qt::Key_Escape,
                        Qt::Key_W,   Qt::Key_Minus,  Qt::Key_Left,  Qt::Key_Down, Qt::Key_H, Qt::Key_3};
  qint64 longest = 0;
  // A dialog runs its own event loop: close it.
  QTimer away;
  QObject::connect(&away, &QTimer::timeout, [] {
    if (QWidget* dialog = QApplication::activeModalWidget()) dialog->close();
    if (QWidget* popup = QApplication::activePopupWidget()) popup->close();
  });
  away.start(20);
  for (int i = 0; i < 1000; ++i) {
    QElapsedTimer since;
    since.start();
    const QPoint place(below(window_->width()), 30 + below(window_->height() - 30));
    QWidget* widget = window_->childAt(place);
    if (widget == nullptr) widget = window_.get();
    if (below(2) == 0)
      QTest::mouseClick(widget, below(4) == 0 ? Qt::RightButton : Qt::LeftButton, Qt::NoModifier,
                        widget->mapFrom(window_.get(), place));
    else
      QTest::keyClick(widget, keys[std::size_t(below(int(keys.size())))]);
    QApplication::processEvents();
    longest = std::max(longest, since.elapsed());
  }
  RecordProperty("longest_ms", int(longest));
  ASSERT_TRUE(wait_idle());
  open_rehearsal();
}

}  // namespace
}  // namespace helicarm::gui
