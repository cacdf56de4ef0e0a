// SPDX-License-Identifier: Apache-2.0
#include <QLineEdit>
#include <QProcess>
#include <QTableWidget>

#include "gui/window/window_test.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

class WindowWithTunnels : public Window {
 protected:
  void open_tunnels() {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    ASSERT_TRUE(simulation::write_case(folder_ / "tunnels", simulation::simulate_case(options).value()));
    open_case(folder_ / "tunnels");
    picks_ = state().picks;
  }
  void open_case(const fs::path& folder) {
    drop(*window_, {folder});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  }
  void pick(const std::string& point, const std::string& view, const Eigen::Vector2d& raw) {
    pipeline::Pick pick;
    pick.name = point;
    pick.view = view;
    pick.uv_raw = raw;
    window_->controller().pick(pick);
    ASSERT_TRUE(wait_idle());
  }
  QString cell(const QString& point, int column) {
    auto* table = window_->findChild<QTableWidget*>("endTable");
    for (int row = 0; row < table->rowCount(); ++row)
      if (table->item(row, 0)->text() == point) return table->item(row, column)->text();
    return "no such row";
  }
  /// Picks the end FE where the case has another point.
  void pick_end_at(const std::string& point) {
    for (pipeline::Pick pick : picks_)
      if (pick.name == point) {
        pick.name = "FE";
        window_->controller().pick(pick);
        ASSERT_TRUE(wait_idle());
      }
  }
  Eigen::Vector2d picks_of_case(const std::string& point) {
    for (const pipeline::Pick& pick : picks_)
      if (pick.name == point && pick.view == "AP") return pick.uv_raw;
    throw std::out_of_range(point);
  }
  QString says() { return window_->findChild<QLabel*>("nextPick")->text(); }
  /// With the mouse, in the view's panel.
  void click_at(std::size_t panel, const Eigen::Vector2d& raw) {
    XrayView& view = window_->xray(panel);
    ASSERT_TRUE(wait("the image is shown", [&] {
      return !view.is_computing() && view.place_of({raw.x(), raw.y()}).has_value();
    }));
    QTest::mouseClick(&view, Qt::LeftButton, {}, view.place_of({raw.x(), raw.y()})->toPoint());
    ASSERT_TRUE(wait_idle());
    QTest::qWait(QApplication::doubleClickInterval() + 50);
  }
  void drag(std::size_t panel, const Eigen::Vector2d& raw, const QPoint& by) {
    XrayView& view = window_->xray(panel);
    ASSERT_TRUE(wait("the image is shown", [&] { return view.place_of({raw.x(), raw.y()}).has_value(); }));
    const QPoint from = view.place_of({raw.x(), raw.y()})->toPoint(), to = from + by;
    QTest::mousePress(&view, Qt::LeftButton, {}, from);
    QMouseEvent move(QEvent::MouseMove, to, view.mapToGlobal(QPointF(to)), Qt::NoButton, Qt::LeftButton, {});
    QApplication::sendEvent(&view, &move);
    QTest::mouseRelease(&view, Qt::LeftButton, {}, to);
    ASSERT_TRUE(wait_idle());
  }
  pipeline::Snap snap_of(const std::string& point, const std::string& view) {
    return pick_of(state(), point, view)->snap;
  }
  void choose_row_of(const QString& point) {
    auto* table = window_->findChild<QTableWidget*>("endTable");
    table->setCurrentItem(table->findItems(point, Qt::MatchExactly).front());
  }
  StepStatus plan() { return card(Phase::plan).status; }

  std::vector<pipeline::Pick> picks_;
};

TEST_F(WindowWithTunnels, WrongPickIsUndoneAndRedone) {
  open_tunnels();
  pick_end_at("FS");
  ASSERT_EQ(plan(), StepStatus::refused);
  const auto press = [&](Qt::KeyboardModifiers with) {
    QTest::keyClick(window_.get(), Qt::Key_Z, with);
    EXPECT_TRUE(wait_idle());
  };
  press(Qt::ControlModifier);
  press(Qt::ControlModifier);
  EXPECT_EQ(plan(), StepStatus::good) << card(Phase::plan).why.toStdString();
  press(Qt::ControlModifier | Qt::ShiftModifier);
  press(Qt::ControlModifier | Qt::ShiftModifier);
  EXPECT_EQ(plan(), StepStatus::refused);
}

TEST_F(WindowWithTunnels, DeletedEndIsAskedForAgainAndUndone) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  auto* table = window_->findChild<QTableWidget*>("endTable");
  ASSERT_EQ(table->item(0, 0)->text(), "FS");
  table->setCurrentCell(0, 0, QItemSelectionModel::ClearAndSelect | QItemSelectionModel::Rows);
  QTest::keyClick(table, Qt::Key_Delete);
  ASSERT_TRUE(wait_idle());
  ASSERT_TRUE(next_pick(state()));
  EXPECT_EQ(next_pick(state())->point, "FS");
  EXPECT_TRUE(state().measured);
  EXPECT_NE(plan(), StepStatus::good);
  QTest::keyClick(window_.get(), Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(plan(), StepStatus::good) << card(Phase::plan).why.toStdString();
}

TEST_F(WindowWithTunnels, DraggedPickMovesItsPoint) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  const Eigen::Vector2d before = pick_of(state(), "FS", state().views[0])->uv_raw;
  ASSERT_NO_FATAL_FAILURE(drag(0, before, {25, 0}));
  EXPECT_GT((pick_of(state(), "FS", state().views[0])->uv_raw - before).norm(), 5);
  EXPECT_TRUE(window_->controller().can_undo());
}

TEST_F(WindowWithTunnels, AClickThatFoundNoBallIsNoPickUntilItIsTakenAsItIs) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  window_->controller().erase_picks("FS");
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(find("takeAsClicked")->isEnabled());
  const Eigen::Vector2d nothing = picks_of_case("FS") + Eigen::Vector2d(60, -60);
  const QImage before = window_->xray(0).image_with_marks();
  const int height = window_->findChild<QLabel*>("nextPick")->height();
  ASSERT_NO_FATAL_FAILURE(click_at(0, nothing));
  ASSERT_NE(failure_of(state(), "FS", "AP"), nullptr);
  EXPECT_EQ(next_pick(state())->view, "AP");  // the instruction stays
  EXPECT_THAT(says().toStdString(), HasSubstr("FS is not picked in AP: no ball"));
  EXPECT_EQ(window_->findChild<QLabel*>("nextPick")->height(), height);
  EXPECT_EQ(plan(), StepStatus::warning);
  EXPECT_EQ(cell("FS", 2), "AP (failed)");
  EXPECT_NE(window_->xray(0).image_with_marks(), before);
  screenshot("failed-pick");
  click("takeAsClicked");
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(failure_of(state(), "FS", "AP"), nullptr);
  EXPECT_EQ(snap_of("FS", "AP"), pipeline::Snap::none);
  EXPECT_EQ(next_pick(state())->view, "LAT");
}

TEST_F(WindowWithTunnels, TheSnapOfAnEndIsChangedAfterwards) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  auto* snap = window_->findChild<QCheckBox*>("snap");
  ASSERT_TRUE(snap->isChecked());
  choose_row_of("FS");
  const bool was = snap_of("FS", "AP") == pipeline::Snap::ball;
  ASSERT_EQ(snap->isChecked(), was);
  snap->click();
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(snap_of("FS", "AP") == pipeline::Snap::ball, !was);
  EXPECT_EQ(snap_of("FS", "LAT") == pipeline::Snap::ball, !was);
  EXPECT_EQ(snap_of("FE", "AP") == pipeline::Snap::ball, was);
}

TEST_F(WindowWithTunnels, APickDraggedWithoutSnapIsTakenAsItIs) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  window_->controller().set_snap("FS", pipeline::Snap::ball);
  ASSERT_TRUE(wait_idle());
  window_->findChild<QCheckBox*>("snap")->click();
  ASSERT_NO_FATAL_FAILURE(drag(0, pick_of(state(), "FS", "AP")->uv_raw, {25, 0}));
  EXPECT_EQ(snap_of("FS", "AP"), pipeline::Snap::none);
  EXPECT_EQ(snap_of("FS", "LAT"), pipeline::Snap::ball);
}

TEST_F(WindowWithTunnels, AnExportIsConfirmedWithItsFolderAndWhatItLacks) {
  open_tunnels();
  window_->controller().erase_picks("FS");
  ASSERT_TRUE(wait_idle());
  EXPECT_THAT(find<QLabel>("exportLacks")->text().toStdString(), HasSubstr("FS is not picked"));
  window_->controller().export_to(folder_ / "export");
  ASSERT_TRUE(wait_idle());
  QTest::qWait(300);
  EXPECT_TRUE(window_->strip().button(Phase::verify)->isChecked());
  for (const char* label : {"exportedTo", "told"}) {
    const std::string words = find<QLabel>(label)->text().toStdString();
    EXPECT_THAT(words, HasSubstr((folder_ / "export").string())) << label;
    EXPECT_THAT(words, HasSubstr("FS is not picked")) << label;
  }
  screenshot("exported");
  QTest::keyClick(window_.get(), Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(wait_idle());
  EXPECT_THAT(find<QLabel>("exportedTo")->text().toStdString(), HasSubstr("Changed since"));
}

TEST_F(WindowWithTunnels, WrongPickRefusesThePlanUntilItIsPickedAgain) {
  open_tunnels();
  pick_end_at("FS");
  EXPECT_EQ(card(Phase::plan).status, StepStatus::refused);
  EXPECT_THAT(card(Phase::plan).why.toStdString(), HasSubstr("bad_tunnel"));
  EXPECT_TRUE(state().measured);
  pick_end_at("FE");
  EXPECT_EQ(card(Phase::plan).status, StepStatus::good) << card(Phase::plan).why.toStdString();
}

TEST_F(WindowWithTunnels, LandmarkIsLocatedAndSavedInTheCase) {
  open_tunnels();
  window_->findChild<QLineEdit*>("landmarkName")->setText("notch");
  window_->findChild<QLineEdit*>("landmarkBone")->setText("humerus");
  window_->findChild<QComboBox*>("landmarkSide")->setCurrentIndex(1);
  click("addLandmark");
  EXPECT_EQ(window_->findChild<QLabel*>("nextPick")->text(),
            "notch is selected: click its new position in each X-ray image.");
  for (const std::string& view : state().views) pick("notch", view, pick_of(state(), "FS", view)->uv_raw);
  EXPECT_EQ(cell("notch", 1), "landmark, left humerus");
  EXPECT_EQ(cell("notch", 2), "AP, LAT");
  EXPECT_FALSE(cell("notch", 3) == "–");
  const fs::path unsaved = folder_ / "tunnels" / "unsaved_picks.json";
  EXPECT_TRUE(fs::exists(unsaved));
  EXPECT_FALSE(window_->findChild<QLabel*>("unsavedPicks")->isHidden());
  QTest::keyClick(window_.get(), Qt::Key_S, Qt::ControlModifier);
  EXPECT_FALSE(fs::exists(unsaved));
  EXPECT_TRUE(window_->findChild<QLabel*>("unsavedPicks")->isHidden());
  EXPECT_THAT(find<QLabel>("told")->text().toStdString(), HasSubstr("case.json"));
  const auto saved = pipeline::read_case(folder_ / "tunnels");
  ASSERT_TRUE(saved) << saved.error().message;
  EXPECT_EQ(std::ranges::count(saved->picks, std::string("notch"), &pipeline::Pick::name), 2);
  EXPECT_EQ(saved->picks.size(), picks_.size() + 2);
  EXPECT_EQ(saved->picks.back().bone, (pipeline::BoneLabel{"humerus", pipeline::Side::left}));
}

TEST_F(WindowWithTunnels, TunnelsThatAreNotWantedAreAskedForNoMore) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  EXPECT_FALSE(find("noTunnels")->isVisible());
  window_->controller().clear_picks();
  ASSERT_TRUE(wait_idle());
  ASSERT_TRUE(next_pick(state()));
  click("noTunnels");
  EXPECT_FALSE(next_pick(state()));
  window_->controller().add_landmark("notch");
  EXPECT_EQ(says().toStdString(), "Click notch in AP.");
}

TEST_F(WindowWithTunnels, TheSelectionStaysOnItsPointWhenRowsAboveItEnd) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  window_->controller().clear_picks();
  ASSERT_TRUE(wait_idle());
  for (const char* name : {"notch", "ridge"}) window_->controller().add_landmark(name);
  auto* ends = find<QTableWidget>("endTable");
  const auto row_of = [&](const QString& name) {
    return ends->findItems(name, Qt::MatchExactly).front()->row();
  };
  ends->selectRow(row_of("notch"));
  click("noTunnels");
  EXPECT_EQ(ends->currentRow(), row_of("notch"));
  EXPECT_TRUE(ends->item(row_of("notch"), 0)->isSelected());
  EXPECT_THAT(says().toStdString(), HasSubstr("notch is selected"));
}

TEST_F(WindowWithTunnels, LandmarkOfATakenNameIsRefused) {
  open_tunnels();
  window_->controller().add_landmark("FS");
  window_->controller().add_landmark("");
  EXPECT_TRUE(state().landmarks.empty());
}

TEST_F(WindowWithTunnels, AnotherCaseLosesNoPicks) {
  open_tunnels();
  pick("FE", "AP", {300, 310});
  fs::copy(folder_ / "tunnels", folder_ / "other", fs::copy_options::recursive);
  fs::remove(folder_ / "other" / "unsaved_picks.json");
  open_case(folder_ / "other");
  EXPECT_EQ(pick_of(state(), "FE", "AP")->uv_raw, picks_of_case("FE"));
  open_case(folder_ / "tunnels");
  EXPECT_EQ(pick_of(state(), "FE", "AP")->uv_raw, Eigen::Vector2d(300, 310));
}

TEST_F(WindowWithTunnels, UnreadableUnsavedPicksAreLeftAndTheCaseOpens) {
  open_tunnels();
  const fs::path folder = folder_ / "other";
  fs::copy(folder_ / "tunnels", folder, fs::copy_options::recursive);
  ASSERT_TRUE(write_file(folder / "unsaved_picks.json", "[{"));
  open_case(folder);
  EXPECT_THAT(window_->findChild<QLabel*>("unsavedPicks")->text().toStdString(),
              HasSubstr("unsaved_picks.json"));
  EXPECT_EQ(state().picks.size(), picks_.size());
  pick("FE", "AP", {300, 310});
  EXPECT_EQ(*read_file(folder / "unsaved_picks.json", 100), "[{");
}

constexpr const char* case_variable = "HELICARM_CASE_TO_PICK_IN";

/// Run by `PicksSurviveAKilledProgram`, in a process of its own.
TEST_F(WindowWithTunnels, DISABLED_PicksAndWaits) {
  open_case(qEnvironmentVariable(case_variable).toStdString());
  pick("FE", "AP", {300, 310});
  std::fputs("picked\n", stdout);
  std::fflush(stdout);
  wait("the end", [] { return false; });
}

TEST_F(WindowWithTunnels, PicksSurviveAKilledProgram) {
  open_tunnels();
  const fs::path folder = folder_ / "killed";
  fs::copy(folder_ / "tunnels", folder, fs::copy_options::recursive);
  QProcess other;
  auto environment = QProcessEnvironment::systemEnvironment();
  environment.insert(case_variable, QString::fromStdString(folder.string()));
  for (const char* name : {"GTEST_TOTAL_SHARDS", "GTEST_SHARD_INDEX"})
    environment.remove(name);  // it may be in another part
  other.setProcessEnvironment(environment);
  other.start(QCoreApplication::applicationFilePath(),
              {"--gtest_filter=*.DISABLED_PicksAndWaits", "--gtest_also_run_disabled_tests"});
  QByteArray said;
  ASSERT_TRUE(wait("the other program has picked", [&] {
    other.waitForReadyRead(20);
    return (said += other.readAllStandardOutput()).contains("picked");
  })) << said.toStdString();
  other.kill();
  other.waitForFinished();
  open_case(folder);
  EXPECT_EQ(pick_of(state(), "FE", "AP")->uv_raw, Eigen::Vector2d(300, 310));
  EXPECT_TRUE(state().has_unsaved_picks);
  EXPECT_THAT(find<QLabel>("told")->text().toStdString(), HasSubstr("restored"));
  QTest::keyClick(window_.get(), Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(pick_of(state(), "FE", "AP")->uv_raw, picks_of_case("FE"));
}

}  // namespace
}  // namespace helicarm::gui
