// SPDX-License-Identifier: Apache-2.0
// Response times and memory, printed.
#include <fstream>

#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace {

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident = 0;
  statm >> pages >> resident;
  return resident * double(::sysconf(_SC_PAGESIZE)) / 1e6;
}

/// Delay from each new pose to its display as the tool's line.
class PoseToPixels : public QObject {
 public:
  explicit PoseToPixels(MainWindow& window) : window_(window) { window.xray(1).installEventFilter(this); }
  std::vector<double> latencies_ms;

 protected:
  bool eventFilter(QObject*, QEvent* event) override {
    const LiveState& shown = window_.live();
    if (event->type() != QEvent::Paint || !shown.tool || !*shown.tool) return false;
    const double taken_s = shown.at_s - (*shown.tool)->age_s;
    if (taken_s - newest_s_ < 1e-4) return false;
    newest_s_ = taken_s;
    // After this paint event and its flush.
    QTimer::singleShot(0, this, [this, taken_s] {
      latencies_ms.push_back((tracker::monotonic_seconds() - taken_s) * 1000);
    });
    return false;
  }

 private:
  MainWindow& window_;
  double newest_s_ = 0;
};

/// Prints times: HELICARM_TIMING=1.
TEST_F(Window, ReportsItsTimes) {
  if (!qEnvironmentVariableIsSet("HELICARM_TIMING")) GTEST_SKIP() << "only with HELICARM_TIMING";
  QElapsedTimer since;
  since.start();
  MainWindow fresh(folder_ / "fresh");
  fresh.resize(1280, 800);
  fresh.show();
  ASSERT_TRUE(QTest::qWaitForWindowExposed(&fresh));
  std::printf("window on the screen after %lld ms\n", since.elapsed());
  fresh.open_rehearsal({});
  ASSERT_TRUE(
      wait("the rehearsal is open", [&] { return fresh.controller().state().source == Source::virtual_or; }));
  std::printf("rehearsal ready after %lld ms\n", since.elapsed());
  fresh.close();

  register_in_rehearsal();
  std::vector<double> redraw, scene;
  for (int i = 0; i < 200; ++i) {
    QTest::qWait(7);
    since.restart();
    window_->show_live();
    QApplication::processEvents();
    redraw.push_back(double(since.nsecsElapsed()) / 1e6);
    scene.push_back(window_->scene().last_render_ms());
  }
  std::vector<double> whole;
  for (int i = 0; i < 100; ++i) {
    QTest::qWait(7);
    since.restart();
    window_->scene().show_live({});
    for (int look = 0; look < 4; ++look) window_->show_live();  // every fourth call updates the scene
    QApplication::processEvents();
    whole.push_back(double(since.nsecsElapsed()) / 1e6);
  }
  PoseToPixels pixels(*window_);
  QTest::qWait(10000);
  const auto notify = [](const char* what, std::vector<double>& ms) {
    std::ranges::sort(ms);
    std::printf("%s: median %.1f ms, 95 %% below %.1f, worst %.1f (%zu)\n", what, ms[ms.size() / 2],
                ms[ms.size() * 95 / 100], ms.back(), ms.size());
  };
  notify("live data updated, the scene every fourth time", redraw);
  notify("both X-ray images and the scene redrawn", whole);
  notify("scene drawn", scene);
  notify("from the tracker's pose to the tool's line on the screen", pixels.latencies_ms);
  std::printf("longest blocking of the interface: %lld ms, event %s\n", WatchedApplication::longest_ms,
              WatchedApplication::longest_what.c_str());
}

/// Operations in sequence for the given minutes: HELICARM_SOAK=30.
TEST_F(Window, KeepsItsMemoryOverManyOperations) {
  const double minutes = qEnvironmentVariable("HELICARM_SOAK").toDouble();
  if (minutes == 0) GTEST_SKIP() << "only with HELICARM_SOAK";
  QElapsedTimer since;
  since.start();
  register_in_rehearsal();
  const auto done = [&] { ASSERT_TRUE(wait_idle()); };
  Controller& controller = window_->controller();
  int outcomes = 0;
  for (int round = 0; since.elapsed() < minutes * 60000; ++round) {
    if (live().robot.phase != robot::LinkPhase::ready) controller.unlock("soak", live().robot), done();
    if (state().tool_is_out) controller.withdraw(), done();
    if (round % 10 == 9) {
      shoot_both();
      controller.take_offered_picks(), done();
    }
    controller.plan_order(state().tunnels[std::size_t(round % 2)].name), done();
    controller.go(), done();
    outcomes += state().tool_is_out && state().refusals.empty();
    std::printf("%5.1f min: %.1f MB, %d outcomes of %d\n", double(since.elapsed()) / 60000, resident_mb(),
                outcomes, round + 1);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace helicarm::gui
