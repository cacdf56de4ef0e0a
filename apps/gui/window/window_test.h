// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QApplication>
#include <QTest>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "gui/desk/steps.h"
#include "gui/window/main_window.h"
#include "helicarm/core/files.h"

/// The window for real: events of mouse and keyboard, on a screen, against the virtual operating room.
namespace helicarm::gui {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int long_ms = 120000;

/// Which event held the interface up longest, and for how long. Loops within an event (a dialog's) count as
/// theirs.
class WatchedApplication : public QApplication {
 public:
  using QApplication::QApplication;

  bool notify(QObject* receiver, QEvent* event) override {
    const QString what = QString("%1 of %2 \"%3\"")
                             .arg(int(event->type()))
                             .arg(receiver->metaObject()->className(), receiver->objectName());
    QElapsedTimer since;
    since.start();
    const bool done = QApplication::notify(receiver, event);
    if (since.elapsed() > longest_ms) longest_ms = since.elapsed(), longest_what = what.toStdString();
    return done;
  }

  static inline qint64 longest_ms = 0;
  static inline std::string longest_what;
};

/// A window on the screen, and a folder that goes with it.
class Window : public testing::Test {
 protected:
  Window() : folder_(fs::temp_directory_path() / ("helicarm_window_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    QSettings().clear();
    window_ = std::make_unique<MainWindow>(folder_ / "sessions");
    window_->resize(1280, 800);
    window_->show();
    EXPECT_TRUE(QTest::qWaitForWindowExposed(window_.get()));
    QApplication::setActiveWindow(window_.get());  // a bare screen has no manager that would
  }
  ~Window() override {
    window_.reset();
    fs::remove_all(folder_);
  }

  const DeskState& state() { return window_->desk().state(); }
  StepCard card(Phase phase) { return window_->strip().button(phase)->card(); }
  LiveState live() { return window_->desk().live(); }
  Lamp lamp(const QString& name) {
    for (const Lamp& lamp : live().lamps)
      if (lamp.name == name) return lamp;
    ADD_FAILURE() << "no lamp " << name.toStdString();
    return {};
  }
  template <class Done>
  bool wait(const Done& done, int patience_ms = long_ms) {
    if (QTest::qWaitFor(done, patience_ms)) return true;
    std::string why = "doing \"" + state().doing + "\"";
    for (const auto& [phase, failure] : state().refusals) why += "; " + sentence_of(failure).toStdString();
    ADD_FAILURE() << "waited in vain; " << why;
    return false;
  }
  /// For what the robot was told to do; its refusal ends the wait.
  template <class Done>
  bool wait_for_robot(const Done& done) {
    return wait([&] { return !state().busy && (done() || state().refusals.contains(Phase::navigate)); }) &&
           done();
  }
  bool wait_idle() {
    return wait([&] { return !state().busy; });
  }
  template <class Widget = QPushButton>
  Widget* find(const char* name) {
    auto* found = window_->findChild<Widget*>(name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  }
  void click(const char* name) { QTest::mouseClick(find(name), Qt::LeftButton); }
  /// With the mouse, or with Enter.
  void hold(const char* name, bool by_key = false) {
    auto* button = find<HoldButton>(name);
    if (!QTest::qWaitFor([&] { return button->isEnabled(); }, 10000)) return;
    if (by_key) {
      button->setFocus();
      QTest::keyPress(button, Qt::Key_Return);
      QTest::qWait(HoldButton::hold_ms + 150);
      QTest::keyRelease(button, Qt::Key_Return);
    } else {
      QTest::mousePress(button, Qt::LeftButton);
      QTest::qWait(HoldButton::hold_ms + 150);
      QTest::mouseRelease(button, Qt::LeftButton);
    }
  }
  /// A busy machine holds tracker and robot up, and then the robot stops, as it must: a person unlocks it and
  /// tries again.
  void with_robot(const std::function<void()>& attempt, const std::function<bool()>& done) {
    for (int left = 6; left > 0 && !done(); --left) {
      if (live().robot.phase != LinkPhase::ready) {
        hold("unlock");
        ASSERT_TRUE(wait_idle());
      }
      if (state().tool_is_out) {
        hold("withdraw");
        ASSERT_TRUE(wait_idle());
      }
      if (state().tool_is_out || live().robot.phase != LinkPhase::ready) continue;
      attempt();
      wait_for_robot(done);
    }
    ASSERT_TRUE(done()) << card(Phase::navigate).why.toStdString();
  }
  /// In a rehearsal of its own. A busy machine may stop the robot before it has moved.
  void begin_to_register() {
    open_rehearsal();
    for (int left = 3; left > 0; --left) {
      hold("unlock");
      ASSERT_TRUE(wait([&] { return live().robot.phase == LinkPhase::ready; }));
      hold("register");
      const auto begun = [&] { return live().robot.phase == LinkPhase::moving || !state().busy; };
      ASSERT_TRUE(wait(begun));
      if (live().robot.phase == LinkPhase::moving) return;
    }
    FAIL() << card(Phase::navigate).why.toStdString();
  }
  void register_in_rehearsal() {
    open_rehearsal();
    shoot_both();
    window_->desk().take_offered_picks();
    ASSERT_TRUE(wait([&] { return state().result->points.size() > 3 && !state().busy; }));
    hold("unlock");
    ASSERT_TRUE(wait([&] { return live().robot.phase == LinkPhase::ready; }));
    with_robot([&] { hold("register"); }, [&] { return state().hand_eye_rms_mm.has_value(); });
  }
  /// Kept where HELICARM_SCREENSHOTS says.
  void screenshot(const char* name) {
    QTest::qWait(100);
    if (const char* place = std::getenv("HELICARM_SCREENSHOTS"))
      window_->grab().save(QString("%1/%2.png").arg(place, name));
  }

  void open_rehearsal() {
    window_->open_rehearsal();
    ASSERT_TRUE(wait([&] { return state().source == Source::virtual_room && !state().busy; }));
  }
  void shoot_both() {
    click("shootAP");
    ASSERT_TRUE(wait([&] { return !state().busy && state().result->views[0].exposure; }));
    auto* lateral = find("shootLAT");
    lateral->setFocus();
    QTest::keyClick(lateral, Qt::Key_Return);
    ASSERT_TRUE(wait([&] { return state().measured && !state().busy; }));
  }
  Json result_file() {
    const fs::path newest = state().folder / ("case-" + std::to_string(state().measurements)) / "result.json";
    return read_json(newest).value();
  }
  void pick_all() {
    while (const auto wanted = next_pick(state())) {
      const std::size_t view = wanted->view == "AP" ? 0 : 1;
      const auto offered = std::ranges::find_if(state().offered_picks, [&](const Pick& pick) {
        return pick.name == wanted->point && pick.view == wanted->view;
      });
      XrayView& xray = window_->xray(view);
      ASSERT_TRUE(wait([&] { return !xray.is_computing(); }));
      const auto place = xray.place_of({offered->uv_raw.x(), offered->uv_raw.y()});
      ASSERT_TRUE(place);
      QTest::mouseClick(&xray, Qt::LeftButton, Qt::NoModifier, place->toPoint());
      ASSERT_TRUE(wait([&] { return pick_of(state(), wanted->point, wanted->view) != nullptr; }, 5000));
      QTest::qWait(QApplication::doubleClickInterval() + 50);
    }
    ASSERT_TRUE(wait_idle());
  }

  fs::path folder_;
  std::unique_ptr<MainWindow> window_;
};

}  // namespace helicarm::gui
