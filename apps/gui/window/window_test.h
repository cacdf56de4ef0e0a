// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QApplication>
#include <QDropEvent>
#include <QMimeData>
#include <QTest>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "gui/controller/steps.h"
#include "gui/window/main_window.h"
#include "helicarm/core/files.h"

/// The complete window: mouse and keyboard events, on a screen, with virtual devices.
namespace helicarm::gui {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// Timeout of a wait: longer than any step takes with every core busy.
constexpr int patience_ms = 180000;
/// Timeout of a wait for a button.
constexpr int enabled_ms = 10000;
/// Number of attempts: a busy machine may delay the tracker or stop the robot.
constexpr int most_attempts = 10;
/// The window's steps do not depend on the delay of poses and states on a busy machine.
constexpr operation::FreshnessLimits patient{.pose_s = 3, .state_s = 3, .heartbeat_s = 3};

/// The event that blocked the interface longest, and its duration. Nested event loops (a dialog's) count as
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

inline void drop(QWidget& onto, const std::vector<fs::path>& paths) {
  QMimeData data;
  QList<QUrl> urls;
  for (const fs::path& path : paths) urls << QUrl::fromLocalFile(QString::fromStdString(path.string()));
  data.setUrls(urls);
  QDragEnterEvent enter(QPoint(10, 10), Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&onto, &enter);
  QDropEvent event(QPointF(10, 10), Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&onto, &event);
}

/// A window on the screen with a folder.
class Window : public testing::Test {
 protected:
  Window() : folder_(fs::temp_directory_path() / ("helicarm_window_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    QSettings().clear();
    window_ = std::make_unique<MainWindow>(folder_ / "sessions");
    window_->controller().set_virtual_freshness(patient);
    window_->resize(1280, 800);
    window_->show();
    EXPECT_TRUE(QTest::qWaitForWindowExposed(window_.get()));
    QApplication::setActiveWindow(window_.get());  // without a window manager no window becomes active
  }
  ~Window() override {
    window_.reset();
    fs::remove_all(folder_);
  }

  const ApplicationState& state() { return window_->controller().state(); }
  StepCard card(Phase phase) { return window_->strip().button(phase)->card(); }
  LiveState live() { return window_->controller().live(); }
  StatusIndicator indicator(const QString& name) {
    for (const StatusIndicator& indicator : live().indicators)
      if (indicator.name == name) return indicator;
    ADD_FAILURE() << "no indicator " << name.toStdString();
    return {};
  }
  /// The window's state for the message of a failed wait.
  std::string seen() {
    const ApplicationState& now = state();
    const LiveState devices = live();
    std::string text = now.busy ? fmt::format("busy: \"{}\"", now.doing) : "idle";
    for (const StepCard& step : steps_of(now))
      text += fmt::format("; {} [{}] {} {}", step.name.toStdString(), int(step.status),
                          step.figure.toStdString(), step.why.toStdString());
    text +=
        fmt::format("; robot {}, state {:.3f} s old", robot::name(devices.robot.phase), devices.robot.age_s);
    if (devices.robot.why) text += ", " + sentence_of(*devices.robot.why).toStdString();
    for (const StatusIndicator& indicator : devices.indicators)
      text += fmt::format("; {}: {}", indicator.name.toStdString(), indicator.text.toStdString());
    return text + fmt::format("; {} measurements, {} picks, {} outcomes, tool {}", now.measurements,
                              now.picks.size(), now.outcomes.size(), now.tool_is_out ? "out" : "at rest");
  }
  /// Waits for a state, described by `what`; a timeout fails with the observed state.
  template <class Done>
  bool wait(const char* what, const Done& done) {
    if (QTest::qWaitFor(done, patience_ms)) return true;
    ADD_FAILURE() << "waited " << patience_ms / 1000 << " s until " << what << "; observed: " << seen();
    return false;
  }
  /// Acts, waits until idle, and repeats if the virtual devices refused.
  template <class Act, class Done>
  bool attempt(const char* what, const Act& act, const Done& done) {
    for (int left = most_attempts; left > 0 && !done(); --left) {
      act();
      if (!wait_idle()) return false;
    }
    if (done()) return true;
    ADD_FAILURE() << "tried " << most_attempts << " times until " << what << "; observed: " << seen();
    return false;
  }
  bool wait_idle() {
    return wait("the controller is idle", [&] { return !state().busy; });
  }
  bool wait_for_phase(robot::LinkPhase phase) {
    return wait(fmt::format("the robot is {}", robot::name(phase)).c_str(),
                [&] { return live().robot.phase == phase; });
  }
  template <class Widget = QPushButton>
  Widget* find(const char* name) {
    auto* found = window_->findChild<Widget*>(name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  }
  /// A page follows the devices by a timer: a button may be enabled later than the devices allow it. A
  /// button that stays disabled has no effect, as for a person; the wait for its effect fails or tries again.
  static bool enabled(const QWidget* button) {
    return QTest::qWaitFor([&] { return button->isEnabled(); }, enabled_ms);
  }
  void click(const char* name) {
    auto* button = find(name);
    if (enabled(button)) QTest::mouseClick(button, Qt::LeftButton);
  }
  /// With the mouse, or with Enter, until the button is full or disabled.
  void hold(const char* name, bool by_key = false) {
    auto* button = find<HoldButton>(name);
    if (!enabled(button)) return;
    bool over = false;
    const auto full = QObject::connect(button, &HoldButton::held, [&] { over = true; });
    const auto until_over = [&] {
      wait(fmt::format("{} is full", name).c_str(), [&] { return over || !button->isEnabled(); });
    };
    if (by_key) {
      button->setFocus();
      QTest::keyPress(button, Qt::Key_Return);
      until_over();
      QTest::keyRelease(button, Qt::Key_Return);
    } else {
      QTest::mousePress(button, Qt::LeftButton);
      until_over();
      QTest::mouseRelease(button, Qt::LeftButton);
    }
    QObject::disconnect(full);
  }
  bool unlock() {
    return attempt(
        "the robot is unlocked", [&] { hold("unlock"); },
        [&] { return live().robot.phase == robot::LinkPhase::ready; });
  }
  /// Unlocked, with the tool withdrawn from the knee.
  bool make_ready() {
    return attempt(
        "the robot is unlocked and the tool withdrawn",
        [&] { hold(live().robot.phase == robot::LinkPhase::ready ? "withdraw" : "unlock"); },
        [&] { return live().robot.phase == robot::LinkPhase::ready && !state().tool_is_out; });
  }
  /// The robot's actions from its rest position.
  template <class Act, class Done>
  bool with_robot(const char* what, const Act& act, const Done& done) {
    return attempt(
        what,
        [&] {
          if (make_ready()) act();
        },
        done);
  }
  /// Acts while the robot moves, until that action is why it stopped: a busy machine may stop it before, or
  /// the move may end too soon; then repeats with a new rehearsal.
  template <class Act>
  void stop_in_motion(const Act& act, const std::string& why) {
    for (int left = most_attempts; left > 0; --left) {
      ASSERT_NO_FATAL_FAILURE(open_rehearsal());
      ASSERT_TRUE(unlock());
      hold("register");
      const auto moves = [&] { return live().robot.phase == robot::LinkPhase::moving; };
      ASSERT_TRUE(wait("the robot moves or refuses", [&] { return moves() || !state().busy; }));
      if (!moves()) continue;
      act();
      ASSERT_TRUE(wait_idle());
      const auto& refusals = state().refusals;
      const auto refused = refusals.find(Phase::navigate);
      if (!moves() && refused != refusals.end() && refused->second.message.find(why) != std::string::npos)
        return;
    }
    FAIL() << "the robot was not stopped by \"" << why << "\"; observed: " << seen();
  }
  void register_robot(bool by_key = false) {
    ASSERT_TRUE(with_robot(
        "the robot is registered", [&] { hold("register", by_key); },
        [&] { return state().hand_eye_rms_mm.has_value(); }));
  }
  void register_in_rehearsal() {
    open_rehearsal();
    shoot_both();
    window_->controller().take_offered_picks();
    ASSERT_TRUE(
        wait("the picks are located", [&] { return state().result->points.size() > 3 && !state().busy; }));
    register_robot();
  }
  /// Saves to the folder HELICARM_SCREENSHOTS.
  void screenshot(const char* name, QWidget* of = nullptr) {
    QTest::qWait(100);
    if (const QString place = qEnvironmentVariable("HELICARM_SCREENSHOTS"); !place.isEmpty())
      (of ? of : window_.get())->grab().save(QString("%1/%2.png").arg(place, name));
  }

  void open_rehearsal(const MainWindow::RehearsalKind& kind = {}) {
    window_->open_rehearsal(kind);
    ASSERT_TRUE(
        wait("the rehearsal is open", [&] { return state().source == Source::virtual_or && !state().busy; }));
  }
  void shoot_both() {
    ASSERT_TRUE(attempt(
        "AP is acquired", [&] { click("shootAP"); },
        [&] { return state().result->views[0].xray_image != nullptr; }));
    auto* lateral = find("shootLAT");
    ASSERT_TRUE(attempt(
        "LAT is acquired",
        [&] {
          lateral->setFocus();
          QTest::keyClick(lateral, Qt::Key_Return);
        },
        [&] { return state().result->views[1].xray_image != nullptr; }));
    ASSERT_TRUE(wait("the views are measured", [&] { return state().measured && !state().busy; }));
  }
  fs::path case_folder(int number) { return state().folder / ("case-" + std::to_string(number)); }
  Json result_file() { return read_json(case_folder(state().measurements) / "result.json").value(); }
  void pick_all() {
    while (const auto wanted = next_pick(state())) {
      const std::size_t view = wanted->view == "AP" ? 0 : 1;
      const auto offered = std::ranges::find_if(state().offered_picks, [&](const pipeline::Pick& pick) {
        return pick.name == wanted->point && pick.view == wanted->view;
      });
      XrayView& xray = window_->xray(view);
      ASSERT_TRUE(wait("the X-ray's layers are computed", [&] { return !xray.is_computing(); }));
      const auto place = xray.place_of({offered->uv_raw.x(), offered->uv_raw.y()});
      ASSERT_TRUE(place);
      QTest::mouseClick(&xray, Qt::LeftButton, Qt::NoModifier, place->toPoint());
      ASSERT_TRUE(wait("the click is a pick",
                       [&] { return pick_of(state(), wanted->point, wanted->view) != nullptr; }));
      QTest::qWait(QApplication::doubleClickInterval() + 50);
    }
    ASSERT_TRUE(wait_idle());
  }

  fs::path folder_;
  std::unique_ptr<MainWindow> window_;
};

}  // namespace helicarm::gui
