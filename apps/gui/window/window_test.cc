// SPDX-License-Identifier: Apache-2.0
// The window for real: events of mouse and keyboard, on a screen, against the virtual operating room.
#include <QApplication>
#include <QDropEvent>
#include <QMenu>
#include <QMimeData>
#include <QStandardPaths>
#include <QTest>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "gui/desk/steps.h"
#include "gui/window/main_window.h"
#include "gui/window/style.h"
#include "helicarm/core/files.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int long_ms = 120000;

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
    ASSERT_TRUE(wait([&] { return button->isEnabled(); })) << name;
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
    for (int left = 3; left > 0 && !done(); --left) {
      if (window_->desk().live().robot.phase == LinkPhase::stopped) {
        hold("unlock");
        ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::ready; }));
      }
      attempt();
      wait_for_robot(done);
    }
    ASSERT_TRUE(done()) << card(Phase::navigate).why.toStdString();
  }
  void register_in_rehearsal() {
    open_rehearsal();
    shoot_both();
    window_->desk().take_offered_picks();
    ASSERT_TRUE(wait([&] { return state().result->points.size() > 3 && !state().busy; }));
    hold("unlock");
    ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::ready; }));
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

void drop(QWidget& onto, const std::vector<fs::path>& paths) {
  QMimeData data;
  QList<QUrl> urls;
  for (const fs::path& path : paths) urls << QUrl::fromLocalFile(QString::fromStdString(path.string()));
  data.setUrls(urls);
  QDragEnterEvent enter(QPoint(10, 10), Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&onto, &enter);
  QDropEvent event(QPointF(10, 10), Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&onto, &event);
}

TEST_F(Window, GoesThroughAllSixStepsByMouseAndKeyboard) {
  screenshot("0-start");
  open_rehearsal();
  EXPECT_EQ(card(Phase::acquire).mood, StepMood::waiting);
  screenshot("1-acquire");
  shoot_both();
  for (const Phase phase : {Phase::acquire, Phase::rectify, Phase::calibrate})
    EXPECT_TRUE(card(phase).mood == StepMood::good || card(phase).mood == StepMood::warning);
  const Json first = result_file();
  EXPECT_THAT(
      card(Phase::calibrate).figure.toStdString(),
      HasSubstr(fmt::format("FRE {:.3f} mm", first.at("accuracy").at("fre_mm").at("mean").get<double>())));
  for (const Phase phase : {Phase::rectify, Phase::calibrate}) {
    QTest::mouseClick(window_->strip().button(phase), Qt::LeftButton);
    QTest::qWait(300);
    screenshot(phase == Phase::rectify ? "2-rectify" : "3-calibrate");
  }

  QTest::keyClick(window_.get(), Qt::Key_4, Qt::AltModifier);
  ASSERT_TRUE(wait([&] { return window_->strip().button(Phase::plan)->isChecked(); }, 2000));
  pick_all();
  ASSERT_TRUE(card(Phase::plan).mood == StepMood::good || card(Phase::plan).mood == StepMood::warning)
      << card(Phase::plan).why.toStdString();
  const Json second = result_file();
  ASSERT_EQ(second["points"].size(), state().result->points.size());
  auto* ends = find<QTableWidget>("endTable");
  ASSERT_EQ(ends->rowCount(), 4);
  for (int row = 0; row < 4; ++row)
    for (const Json& point : second["points"])
      if (point["name"] == ends->item(row, 0)->text().toStdString()) {
        EXPECT_EQ(ends->item(row, 3)->text().toStdString(),
                  fmt::format("{:.2f}", point["ray_gap_mm"].get<double>()));
      }
  screenshot("4-plan");

  hold("unlock");
  ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::ready; }));
  with_robot([&] { hold("register", true); }, [&] { return state().hand_eye_rms_mm.has_value(); });
  for (const PlannedTunnel& tunnel : state().tunnels) {
    find<QComboBox>("tunnel")->setCurrentText(QString::fromStdString(tunnel.name));
    const auto go = [&] {
      ASSERT_TRUE(wait([&] { return find("planWay")->isEnabled(); }));
      click("planWay");
      ASSERT_TRUE(wait_for_robot([&] { return state().order.has_value(); }));
      if (state().outcomes.empty()) screenshot("5-path");
      hold("go");
    };
    with_robot(go, [&] { return state().outcomes.contains(tunnel.name); });
    screenshot("6-navigate");
    with_robot([&] { hold("withdraw"); }, [&] { return !state().tool_is_out; });
    ASSERT_FALSE(HasFatalFailure());
  }
  EXPECT_EQ(card(Phase::navigate).mood, StepMood::good);
  EXPECT_EQ(card(Phase::verify).mood, StepMood::good);
  QTest::keyClick(window_.get(), Qt::Key_6, Qt::AltModifier);
  ASSERT_TRUE(wait([&] { return window_->strip().button(Phase::verify)->isChecked(); }, 2000));
  auto* table = find<QTableWidget>("outcomeTable");
  ASSERT_EQ(table->rowCount(), 4);
  // Two checks followed the measurement of the picks; the last one is of the last tunnel.
  const fs::path last = state().folder / ("case-" + std::to_string(state().measurements + 2));
  const Json checked = read_json(last / "result.json").value();
  const Json& line = checked.at("verification").at(0);
  const int row = state().tunnels.back().name > state().tunnels.front().name ? 2 : 0;
  EXPECT_EQ(table->item(row, 3)->text().toStdString(),
            fmt::format("{:.2f}", line.at("err_start_px").get<double>()));
  window_->scene().set_preset(SceneView::Preset::lateral);
  screenshot("7-verify");

  window_->desk().export_to(folder_ / "export");
  ASSERT_TRUE(wait_idle());
  for (const char* file : {"report.html", "report.pdf", "result.json"})
    EXPECT_TRUE(fs::exists(folder_ / "export" / file)) << file;
}

TEST_F(Window, SpaceBarStopsTheRobotWhateverHasTheFocus) {
  open_rehearsal();
  hold("unlock");
  ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::ready; }));
  hold("register");
  ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::moving; }));
  QTest::keyClick(find("shootAP"), Qt::Key_Space);
  ASSERT_TRUE(wait([&] { return window_->desk().live().robot.phase == LinkPhase::stopped; }, 2000));
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(card(Phase::navigate).mood, StepMood::refused);
  EXPECT_FALSE(find<HoldButton>("go")->isEnabled());
}

TEST_F(Window, ShortPressOnAYellowButtonDoesNothing) {
  open_rehearsal();
  auto* unlock = find<HoldButton>("unlock");
  ASSERT_TRUE(wait([&] { return unlock->isEnabled(); }));
  QTest::mouseClick(unlock, Qt::LeftButton);
  QTest::keyClick(unlock, Qt::Key_Return);
  QTest::qWait(HoldButton::hold_ms + 200);
  EXPECT_EQ(window_->desk().live().robot.phase, LinkPhase::idle);
}

TEST_F(Window, PulledCablesShowWithinASecondAndAHalf) {
  open_rehearsal();
  const auto lamp = [&](int number) { return window_->desk().live().lamps.at(std::size_t(number)).light; };
  ASSERT_TRUE(wait([&] { return lamp(3) == Light::green && lamp(4) == Light::amber; }));
  window_->desk().set_fault("silent", true);
  EXPECT_TRUE(wait([&] { return lamp(1) == Light::red && lamp(3) == Light::red; }, 1500));
  window_->desk().set_fault("silent", false);
  EXPECT_TRUE(wait([&] { return lamp(1) == Light::green; }, 3000));
}

TEST_F(Window, RefusedCalibrationIsShownWithItsReasonAndNothingIsOffered) {
  simulation::SimulationOptions options;
  options.size = 512;
  auto simulated = simulation::simulate_case(options).value();
  for (auto& pixel : simulated.views[1].pixels.pixels()) pixel = 2000;
  ASSERT_TRUE(simulation::write_case(folder_ / "blank", simulated));
  drop(*window_, {folder_ / "blank"});
  ASSERT_TRUE(wait([&] { return state().source == Source::files && !state().busy; }));
  EXPECT_EQ(card(Phase::rectify).mood, StepMood::refused);
  EXPECT_THAT(card(Phase::rectify).why.toStdString(), HasSubstr("blank_image"));
  EXPECT_FALSE(state().measured);
  window_->desk().export_to(folder_ / "export");
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(fs::exists(folder_ / "export"));
}

TEST_F(Window, BadFilesDroppedOnItAreRefusedByName) {
  std::ofstream(folder_ / "a.dcm") << "no picture";
  std::ofstream(folder_ / "b.dcm") << "nor this";
  for (const auto& paths : {std::vector<fs::path>{folder_ / "a.dcm", folder_ / "b.dcm"},
                            {folder_ / "a.dcm"},
                            {folder_ / "gone"},
                            {folder_}}) {
    drop(*window_, paths);
    ASSERT_TRUE(wait_idle());
    EXPECT_EQ(card(Phase::acquire).mood, StepMood::refused);
    EXPECT_FALSE(card(Phase::acquire).why.isEmpty());
  }
}

TEST_F(Window, ThousandRandomClicksAndKeysFreezeNothing) {
  open_rehearsal();
  std::srand(7);
  const std::array keys{Qt::Key_Tab, Qt::Key_Return, Qt::Key_Space, Qt::Key_L,    Qt::Key_M, Qt::Key_Plus,
                        Qt::Key_0,   Qt::Key_Up,     Qt::Key_1,     Qt::Key_2,    Qt::Key_R, Qt::Key_Escape,
                        Qt::Key_W,   Qt::Key_Minus,  Qt::Key_Left,  Qt::Key_Down, Qt::Key_H, Qt::Key_3};
  qint64 longest = 0;
  // A dialog runs a loop of its own: somebody puts it away.
  QTimer away;
  QObject::connect(&away, &QTimer::timeout, [] {
    if (QWidget* dialog = QApplication::activeModalWidget()) dialog->close();
    if (QWidget* popup = QApplication::activePopupWidget()) popup->close();
  });
  away.start(20);
  for (int i = 0; i < 1000; ++i) {
    QElapsedTimer since;
    since.start();
    const QPoint place(std::rand() % window_->width(), 30 + std::rand() % (window_->height() - 30));
    QWidget* widget = window_->childAt(place);
    if (widget == nullptr) widget = window_.get();
    if (std::rand() % 2 == 0)
      QTest::mouseClick(widget, std::rand() % 4 == 0 ? Qt::RightButton : Qt::LeftButton, Qt::NoModifier,
                        widget->mapFrom(window_.get(), place));
    else
      QTest::keyClick(widget, keys[std::size_t(std::rand()) % keys.size()]);
    QApplication::processEvents();
    longest = std::max(longest, since.elapsed());
  }
  RecordProperty("longest_ms", int(longest));
  ASSERT_TRUE(wait_idle());
  window_->open_rehearsal();
  ASSERT_TRUE(wait([&] { return state().source == Source::virtual_room && !state().busy; }));
}

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident = 0;
  statm >> pages >> resident;
  return resident * double(::sysconf(_SC_PAGESIZE)) / 1e6;
}

/// Times, for a person: HELICARM_TIMING=1.
TEST_F(Window, TellsItsTimes) {
  if (std::getenv("HELICARM_TIMING") == nullptr) GTEST_SKIP() << "only with HELICARM_TIMING";
  QElapsedTimer since;
  since.start();
  MainWindow fresh(folder_ / "fresh");
  fresh.resize(1280, 800);
  fresh.show();
  ASSERT_TRUE(QTest::qWaitForWindowExposed(&fresh));
  std::printf("window on the screen after %lld ms\n", since.elapsed());
  fresh.open_rehearsal();
  ASSERT_TRUE(wait([&] { return fresh.desk().state().source == Source::virtual_room; }));
  std::printf("rehearsal ready after %lld ms\n", since.elapsed());
  fresh.close();

  register_in_rehearsal();
  std::vector<double> redraw, scene, latency;
  for (int i = 0; i < 200; ++i) {
    QTest::qWait(7);
    const LiveState live = window_->desk().live();
    since.restart();
    window_->show_live();
    QApplication::processEvents();
    redraw.push_back(double(since.nsecsElapsed()) / 1e6);
    if (live.tool && *live.tool) latency.push_back((*live.tool)->age_s * 1000 + redraw.back());
    scene.push_back(window_->scene().last_render_ms());
  }
  const auto tell = [](const char* what, std::vector<double>& ms) {
    std::ranges::sort(ms);
    std::printf("%s: median %.1f ms, 95 %% below %.1f, worst %.1f (%zu)\n", what, ms[ms.size() / 2],
                ms[ms.size() * 95 / 100], ms.back(), ms.size());
  };
  tell("all that is live shown anew", redraw);
  tell("scene drawn", scene);
  tell("from the tracker's pose to the tool's line on the screen", latency);
}

/// Operations one after the other for so many minutes: HELICARM_SOAK=30.
TEST_F(Window, KeepsItsMemoryOverManyOperations) {
  const char* minutes = std::getenv("HELICARM_SOAK");
  if (minutes == nullptr) GTEST_SKIP() << "only with HELICARM_SOAK";
  QElapsedTimer since;
  since.start();
  register_in_rehearsal();
  for (int round = 0; since.elapsed() < std::atof(minutes) * 60000; ++round) {
    const std::string tunnel = state().tunnels[std::size_t(round % 2)].name;
    window_->desk().plan_tunnel(tunnel);
    ASSERT_TRUE(wait([&] { return !state().busy; }));
    window_->desk().go();
    ASSERT_TRUE(wait([&] { return !state().busy; }));
    window_->desk().withdraw();
    ASSERT_TRUE(wait([&] { return !state().busy; }));
    std::printf("%5.1f min: %.1f MB, %zu outcomes, %zu refusals\n", double(since.elapsed()) / 60000,
                resident_mb(), state().outcomes.size(), state().refusals.size());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace helicarm::gui

int main(int argc, char** argv) {
  QStandardPaths::setTestModeEnabled(true);
  QApplication app(argc, argv);
  QApplication::setOrganizationName("helicarm");
  QApplication::setApplicationName("helicarm-gui-test");
  app.setStyleSheet(helicarm::gui::style::sheet());
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
