// SPDX-License-Identifier: Apache-2.0
#include <QMenuBar>

#include "gui/window/window_test.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

class WindowMeasures : public Window {
 protected:
  void open_tunnels() {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    ASSERT_TRUE(simulation::write_case(folder_ / "tunnels", simulation::simulate_case(options).value()));
    drop(*window_, {folder_ / "tunnels"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
    ASSERT_TRUE(wait("the images are shown",
                     [&] { return !window_->xray(0).is_computing() && !window_->xray(1).is_computing(); }));
  }
  void choose(const QString& tool) {
    for (QAction* menu : window_->menuBar()->actions())
      if (menu->text() == "&Measure")
        for (QAction* action : menu->menu()->actions())
          if (action->text() == tool) return action->trigger();
    FAIL() << "no tool " << tool.toStdString();
  }
  void click(std::size_t view, const QPoint& at) {
    QTest::mouseClick(&window_->xray(view), Qt::LeftButton, {}, at);
    QTest::qWait(QApplication::doubleClickInterval() + 50);
  }
  QTableWidget* table() { return window_->findChild<QTableWidget*>("measuresTable"); }
};

TEST_F(WindowMeasures, MeasuresByMenuWithoutPickingUntilEscape) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  window_->findChild<QTableWidget*>("endTable")->selectRow(0);  // the next click would move this end
  const auto picks = state().picks.size();
  choose("Distance");
  const QPoint middle = window_->xray(0).rect().center();
  click(0, middle);
  click(1, middle);  // another image: not of this measure
  click(0, middle + QPoint(60, 0));
  ASSERT_EQ(table()->rowCount(), 1);
  EXPECT_TRUE(table()->item(0, 4)->text().endsWith(" mm")) << table()->item(0, 4)->text().toStdString();
  choose("Femoral quadrants (Bernard and Hertel)");
  const QPoint lateral = window_->xray(1).rect().center();
  for (const QPoint& at : {QPoint(-60, 0), QPoint(60, -20), QPoint(0, 70)}) click(1, lateral + at);
  QTest::keyClick(&window_->xray(1), Qt::Key_Return);
  // Two lengths, FS and FE, and a line for each of these that lies outside the quadrants.
  EXPECT_GE(table()->rowCount(), 1 + 2 + 2 * 2);
  EXPECT_LE(table()->rowCount(), 1 + 2 + 2 * 3);
  screenshot("measures");
  EXPECT_EQ(state().picks.size(), picks);
  EXPECT_FALSE(state().has_unsaved_picks);
  QTest::keyClick(&window_->xray(1), Qt::Key_Escape);
  click(0, middle);
  EXPECT_TRUE(state().has_unsaved_picks);
}

TEST_F(WindowMeasures, StayWithTheirImages) {
  open_tunnels();
  choose("Distance");
  const QPoint middle = window_->xray(0).rect().center();
  click(0, middle);
  click(0, middle + QPoint(60, 0));
  ASSERT_EQ(table()->rowCount(), 1);
  simulation::SimulationOptions other;
  other.seed = 9;
  ASSERT_TRUE(simulation::write_case(folder_ / "other", simulation::simulate_case(other).value()));
  for (const auto& [folder, rows] : {std::pair("other", 0), {"tunnels", 1}}) {
    drop(*window_, {folder_ / folder});
    ASSERT_TRUE(wait("the case is measured", [&] {
      return state().measured && !state().busy && state().folder.filename() == folder;
    }));
    EXPECT_EQ(table()->rowCount(), rows) << folder;
  }
}

}  // namespace
}  // namespace helicarm::gui
