// SPDX-License-Identifier: Apache-2.0
#include "gui/window/window_test.h"

#include <QMouseEvent>
#include <QStandardPaths>

#include "gui/window/bones_window.h"
#include "gui/window/flat_memory.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

class WholeOperation : public Window {
 protected:
  void expect_ends_as_measured() {
    const Json measured = result_file();
    ASSERT_EQ(measured["points"].size(), state().result->points.size());
    auto* ends = find<QTableWidget>("endTable");
    ASSERT_EQ(ends->rowCount(), 4);
    for (int row = 0; row < 4; ++row)
      for (const Json& point : measured["points"])
        if (point["name"] == ends->item(row, 0)->text().toStdString()) {
          EXPECT_EQ(ends->item(row, 4)->text().toStdString(),
                    fmt::format("{:.3f}", point["ray_gap_mm"].get<double>()));
        }
    EXPECT_GE(state().measurements, 2)
        << "one for the images; ends picked during a measurement are measured together";
    EXPECT_LE(state().measurements, 5);
  }
  void move_to_each_tunnel() {
    for (const operation::OperationTunnel& tunnel : state().tunnels) {
      find<QComboBox>("tunnel")->setCurrentText(QString::fromStdString(tunnel.name));
      const auto go = [&] {
        click("planWay");
        if (!wait_idle() || !state().order) return;
        if (state().outcomes.empty()) screenshot("5-path");
        hold("go");
      };
      ASSERT_TRUE(with_robot("the tool is in the tunnel", go,
                             [&] { return state().outcomes.contains(tunnel.name); }));
      screenshot("6-navigate");
      ASSERT_TRUE(make_ready());
    }
  }
  void expect_outcomes_as_measured() {
    auto* table = find<QTableWidget>("outcomeTable");
    ASSERT_EQ(table->rowCount(), 4);
    // Checks followed the measurement of the picks, at least one for each tunnel; the last one belongs to the
    // last tunnel.
    int last = state().measurements + 2;
    while (fs::exists(case_folder(last + 1))) ++last;
    const Json checked = read_json(case_folder(last) / "result.json").value();
    const Json& line = checked.at("verification").at(0);
    const int row = state().tunnels.back().name > state().tunnels.front().name ? 2 : 0;
    EXPECT_EQ(table->item(row, 4)->text().toStdString(),
              fmt::format("{:.2f}", line.at("err_start_px").get<double>()));
  }
  void expect_export_and_replay() {
    window_->controller().export_to(folder_ / "export");
    ASSERT_TRUE(wait_idle());
    for (const char* file : {"report.html", "report.pdf", "result.json", "measurements.dcm"})
      EXPECT_TRUE(fs::exists(folder_ / "export" / file)) << file;

    window_->open_paths({state().folder});
    auto* replay = window_->findChild<ReplayPanel*>();
    ASSERT_TRUE(replay->timeline());
    replay->set_moment(int(replay->timeline()->moments.size()) - 1);
    ASSERT_TRUE(wait("the replayed tool is shown", [&] { return window_->recorded().has_value(); }));
    EXPECT_EQ(window_->recorded()->by_view.size(), 2u);
    EXPECT_THAT(card(Phase::navigate).figure.toStdString(), HasSubstr("2 of 2 tunnels"));
    EXPECT_EQ(card(Phase::verify).status, StepStatus::good);
    replay->set_moment(0);
    EXPECT_EQ(card(Phase::verify).status, StepStatus::waiting);
    replay->set_moment(int(replay->timeline()->moments.size()) - 1);
    screenshot("8-replay");
  }
};

TEST_F(WholeOperation, CompletesAllSixStepsByMouseAndKeyboard) {
  screenshot("0-start");
  open_rehearsal();
  EXPECT_EQ(card(Phase::acquire).status, StepStatus::waiting);
  screenshot("1-acquire");
  shoot_both();
  for (const Phase phase : {Phase::acquire, Phase::rectify, Phase::calibrate})
    EXPECT_TRUE(card(phase).status == StepStatus::good || card(phase).status == StepStatus::warning);
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
  ASSERT_TRUE(
      wait("the plan's page is chosen", [&] { return window_->strip().button(Phase::plan)->isChecked(); }));
  pick_all();
  ASSERT_TRUE(card(Phase::plan).status == StepStatus::good || card(Phase::plan).status == StepStatus::warning)
      << card(Phase::plan).why.toStdString();
  ASSERT_NO_FATAL_FAILURE(expect_ends_as_measured());
  screenshot("4-plan");

  ASSERT_NO_FATAL_FAILURE(register_robot(true));
  ASSERT_NO_FATAL_FAILURE(move_to_each_tunnel());
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::good);
  EXPECT_EQ(card(Phase::verify).status, StepStatus::good);
  QTest::keyClick(window_.get(), Qt::Key_6, Qt::AltModifier);
  ASSERT_TRUE(wait("the verification's page is chosen",
                   [&] { return window_->strip().button(Phase::verify)->isChecked(); }));
  ASSERT_NO_FATAL_FAILURE(expect_outcomes_as_measured());
  window_->scene().set_preset(SceneView::Preset::lateral);
  screenshot("7-verify");

  std::printf("longest blocking of the interface: %lld ms, event %s\n", WatchedApplication::longest_ms,
              WatchedApplication::longest_what.c_str());
  ASSERT_NO_FATAL_FAILURE(expect_export_and_replay());
  open_rehearsal();
  EXPECT_FALSE(window_->recorded()) << "a tool of previous images";
}

TEST_F(WholeOperation, ReachesATunnelThatWasPlannedInTheCt) {
  open_rehearsal({.by_ct = true});
  shoot_both();
  EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());  // opens there
  auto* confirm = find("confirmRegistration");
  EXPECT_TRUE(confirm->isVisible());
  EXPECT_FALSE(confirm->isEnabled());
  click("registerModels");
  ASSERT_TRUE(wait("the models are registered", [&] { return state().registration && !state().busy; }));
  EXPECT_EQ(card(Phase::registration).status, StepStatus::waiting);
  EXPECT_TRUE(confirm->isEnabled());
  screenshot("ct-register");
  ASSERT_NO_FATAL_FAILURE(register_robot());
  EXPECT_FALSE(find("planWay")->isEnabled());
  EXPECT_THAT(find<QLabel>("robotSays")->text().toStdString(), HasSubstr("confirm their outlines"));
  click("confirmRegistration");
  ASSERT_TRUE(wait("the registration is confirmed", [&] { return state().is_confirmed && !state().busy; }));
  EXPECT_NE(card(Phase::registration).status, StepStatus::waiting);
  EXPECT_FALSE(confirm->isEnabled());
  ASSERT_NO_FATAL_FAILURE(move_to_each_tunnel());
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::good);
  ASSERT_NO_FATAL_FAILURE(expect_outcomes_as_measured());
  click("ctSlices");
  ASSERT_TRUE(wait("the CT is shown", [&] {
    auto* bones = window_->findChild<BonesWindow*>("bones");
    return bones && bones->scene().ct;
  }));
  const CtScene& scene = window_->findChild<BonesWindow*>("bones")->scene();
  ASSERT_EQ(scene.plan.tunnels.size(), 1U);
  ASSERT_TRUE(scene.plan.tunnels[0].approach);
  EXPECT_EQ(scene.body.says, "femur: mask femur.nrrd");
  screenshot("ct-slices", window_->findChild<QDialog*>("bones"));
  ASSERT_NO_FATAL_FAILURE(expect_export_and_replay());
}

TEST(DrillTargets, AreSeenFromBehindTheDrill) {
  const QPointF down = on_target({0, 1}, 40);
  EXPECT_EQ(down.x(), 0);
  EXPECT_EQ(down.y(), 10);
  EXPECT_EQ(on_target({1, 0}, 40), QPointF(10, 0));
  EXPECT_EQ(on_target({0, 100}, 40), QPointF(0, 40));  // at the rim
}

TEST(DrillTargets, SayWhatMakesADecisionUncertain) {
  operation::Guidance guidance;
  guidance.aim = operation::TunnelAim{12.5, 13.2, -14.1, 130.2, 0.65, 1.1, 0.4, {1, 0, 0}, {0, 0, 1}};
  guidance.aim->errors = operation::AimErrors{{0.45, 0.2}, {0.25, 0.6}, {0.15, 0.2}, {0.35, 0.85}};
  guidance.why_not = Failure{Reason::uncertain, "two standard deviations are 1.3 mm and 2.2 degrees"};
  DrillTarget target;
  target.show_guidance(guidance, {});
  const std::string words = target.words().toStdString();
  EXPECT_THAT(words, HasSubstr("uncertain\n2 σ 1.3 mm, 2.2°\nlimit 1 mm, 2°"));
  EXPECT_THAT(words, HasSubstr("tracker 0.5 mm, 1.2°"));
  EXPECT_THAT(words, HasSubstr("scatter 0.7 mm, 1.7°"));
}

TEST(DrillTargets, SayToDrillBetweenEntryAndEndAlone) {
  const auto words_at = [](double depth_mm) {
    operation::Guidance guidance;
    guidance.aim.emplace();
    guidance.aim->length_mm = 30;
    guidance.aim->depth_mm = depth_mm;
    DrillTarget target;
    target.show_guidance(guidance, {});
    return target.words().section('\n', 0, 0).toStdString();
  };
  EXPECT_EQ(words_at(-5), "on target");
  EXPECT_EQ(words_at(12), "on target: drill");
  EXPECT_THAT(words_at(30.2), HasSubstr("stop"));
}

class DrillInTheHand : public Window {
 protected:
  void expect_replay_of_the_drill() {
    window_->open_paths({state().folder});
    auto* replay = window_->findChild<ReplayPanel*>();
    ASSERT_TRUE(replay->timeline());
    const auto& moments = replay->timeline()->moments;
    const auto outcome = std::ranges::find(moments, "outcome", &Moment::kind);
    const auto guided = std::find_if(moments.begin(), outcome, [](const Moment& moment) {
      const auto* record = std::get_if<operation::record::Guided>(&moment.record);
      return record && record->guidance.aim;
    });
    ASSERT_NE(guided, outcome);
    replay->set_moment(int(guided - moments.begin()));
    ASSERT_TRUE(
        wait("the recorded tool is shown", [&] { return !state().busy && window_->recorded().has_value(); }));
    EXPECT_TRUE(window_->strip().button(Phase::navigate)->isChecked());
    auto* target = find<DrillTarget>("drillTarget");
    EXPECT_TRUE(wait("the recorded guidance is shown", [&] {
      return target->words().contains("mm off axis");
    })) << target->words().toStdString();
    EXPECT_EQ(find<QComboBox>("tunnel")->currentText(), "femur");
    for (const char* button :
         {"unlock", "register", "planWay", "go", "withdraw", "guideDrill", "verifyDrilled"})
      EXPECT_FALSE(find(button)->isVisible()) << button;
    for (const QString& words : {find<QLabel>("robotSays")->text(), card(Phase::navigate).why})
      EXPECT_FALSE(words.isEmpty() || words.contains("robot")) << words.toStdString();
    EXPECT_THAT(window_->live_bar().words().toStdString(), HasSubstr("tool: seen"));
    screenshot("drill-replayed");
    replay->set_moment(int(moments.size()) - 1);
    ASSERT_TRUE(wait("the outcomes are shown",
                     [&] { return !state().busy && window_->strip().button(Phase::verify)->isChecked(); }));
    EXPECT_THAT(find<QLabel>("depths")->text().toStdString(), HasSubstr("the drill's tip is"));
    EXPECT_TRUE(wait("no guidance is shown", [&] { return target->words() == "not guided"; }));
    screenshot("drill-replayed-outcome");
  }
};

TEST_F(DrillInTheHand, IsGuidedAndTheTunnelVerified) {
  open_rehearsal({.by_hand = true});
  EXPECT_FALSE(find<HoldButton>("unlock")->isVisibleTo(find<QWidget>("pages")));
  shoot_both();
  window_->controller().take_offered_picks();
  ASSERT_TRUE(
      wait("the picks are located", [&] { return state().result->points.size() > 3 && !state().busy; }));
  QTest::mouseClick(window_->strip().button(Phase::navigate), Qt::LeftButton);
  find<QComboBox>("tunnel")->setCurrentText("femur");
  auto* target = find<DrillTarget>("drillTarget");
  EXPECT_EQ(target->words(), "not guided");
  EXPECT_FALSE(find("verifyDrilled")->isEnabled());
  const auto is_at_the_end = [&] {
    return live().drill && live().drill->aim && live().drill->aim->depth_mm >= live().drill->aim->length_mm;
  };
  for (int left = most_attempts; left > 0 && state().outcomes.empty(); --left) {
    click("guideDrill");
    ASSERT_TRUE(wait("the drill is shown", [&] { return live().drill || !state().busy; }));
    screenshot("drill-guided");
    ASSERT_TRUE(wait("the drill is at the tunnel's end", [&] { return is_at_the_end() || !state().busy; }));
    if (!state().busy) continue;
    EXPECT_THAT(target->words().toStdString(), HasSubstr("mm off axis"));
    click("verifyDrilled");
    ASSERT_TRUE(wait("the tunnel is verified or refused",
                     [&] { return !state().busy || state().refusals.contains(Phase::navigate); }));
    if (state().busy) click("endGuidance");
    ASSERT_TRUE(wait_idle());
  }
  ASSERT_TRUE(state().outcomes.contains("femur"));
  EXPECT_EQ(target->words(), "not guided");
  EXPECT_TRUE(state().outcomes.at("femur").depth());
  EXPECT_THAT(card(Phase::navigate).figure.toStdString(), HasSubstr("1 of 2 tunnels"));
  screenshot("drill-verified");
  QTest::mouseClick(window_->strip().button(Phase::verify), Qt::LeftButton);
  EXPECT_THAT(find<QLabel>("depths")->text().toStdString(), HasSubstr("the drill's tip is"));
  const auto* table = find<QTableWidget>("outcomeTable");
  QStringList shown;
  for (int column = 0; column < table->columnCount(); ++column)
    if (!table->isColumnHidden(column)) shown << table->horizontalHeaderItem(column)->text();
  EXPECT_TRUE(shown.contains("Beyond end, mm") && shown.contains("Error, mm"))
      << shown.join('\n').toStdString();
  screenshot("drill-depth");
  ASSERT_NO_FATAL_FAILURE(expect_replay_of_the_drill());
}

TEST_F(Window, SpaceBarStopsTheRobotWhateverHasTheFocus) {
  ASSERT_NO_FATAL_FAILURE(
      stop_in_motion([&] { QTest::keyClick(find("shootAP"), Qt::Key_Space); }, "stopped by the user"));
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::refused);
  EXPECT_FALSE(find<HoldButton>("go")->isEnabled());
}

TEST_F(Window, DisplayedPathIsWithdrawnWhenTheBoneMovesAndCannotBeConfirmed) {
  ASSERT_NO_FATAL_FAILURE(register_in_rehearsal());
  find<QComboBox>("tunnel")->setCurrentText("femur");
  ASSERT_TRUE(with_robot(
      "a path is planned", [&] { click("planWay"); }, [&] { return state().order.has_value(); }));
  auto* go = find<HoldButton>("go");
  ASSERT_TRUE(go->isEnabled());
  QTest::keyPress(go, Qt::Key_Return);  // and held
  window_->controller().move_bone("femur", {3, 0, 0});
  ASSERT_TRUE(wait("the path is withdrawn", [&] { return !state().order && !state().busy; }));
  EXPECT_FALSE(go->isEnabled());
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::refused);
  EXPECT_THAT(card(Phase::navigate).why.toStdString(), HasSubstr("plan_stale"));
  EXPECT_NE(window_->controller().live().robot.phase, robot::LinkPhase::moving);
}

TEST_F(Window, AfterAStopOnTheWayThePageSaysHowFarOffTheToolIs) {
  ASSERT_NO_FATAL_FAILURE(register_in_rehearsal());
  window_->strip().chosen(Phase::navigate);
  find<QComboBox>("tunnel")->setCurrentText("femur");
  auto* go = find<HoldButton>("go");
  const QPoint place = go->mapTo(window_.get(), QPoint());
  const auto stopped_on_the_way = [&] {
    return state().tool_is_out && !state().has_arrived && !state().busy;
  };
  for (int left = most_attempts; left > 0 && !stopped_on_the_way(); --left) {
    ASSERT_TRUE(make_ready());
    click("planWay");
    ASSERT_TRUE(wait_idle());
    if (!state().order) continue;
    EXPECT_THAT(find<QLabel>("robotSays")->text().toStdString(), HasSubstr("One hold starts"));
    hold("go");
    const auto from = live().robot.state->base_from_tcp.translation;
    ASSERT_TRUE(wait("the tool has moved or the robot refuses", [&] {
      const auto& now = live().robot.state;
      return !state().busy || (now && (now->base_from_tcp.translation - from).norm() > 10);
    }));
    QTest::keyClick(window_.get(), Qt::Key_Space);
    ASSERT_TRUE(wait_idle());
  }
  ASSERT_TRUE(stopped_on_the_way()) << seen();
  EXPECT_FALSE(state().path.by_view.empty());  // stays in sight
  QTest::qWait(300);
  const std::string says = find<QLabel>("robotSays")->text().toStdString();
  EXPECT_THAT(says, HasSubstr("stopped on its way to femur"));
  EXPECT_THAT(says, HasSubstr("mm off its axis"));
  EXPECT_EQ(go->mapTo(window_.get(), QPoint()), place);
  screenshot("stopped");
}

TEST_F(Window, ShortPressOnAYellowButtonDoesNothing) {
  open_rehearsal();
  auto* unlock = find<HoldButton>("unlock");
  ASSERT_TRUE(wait("unlock is enabled", [&] { return unlock->isEnabled(); }));
  QTest::mouseClick(unlock, Qt::LeftButton);
  QTest::keyClick(unlock, Qt::Key_Return);
  QTest::qWait(HoldButton::hold_ms + 200);
  EXPECT_EQ(window_->controller().live().robot.phase, robot::LinkPhase::idle);
}

TEST_F(Window, APointerThatLeavesAYellowButtonLetsItGo) {
  HoldButton button("go");
  button.resize(120, 40);
  button.show();
  int orders = 0;
  QObject::connect(&button, &HoldButton::held, &button, [&] { ++orders; });
  const auto drag_to = [&](const QPoint& place) {
    QMouseEvent move(QEvent::MouseMove, place, button.mapToGlobal(place), Qt::NoButton, Qt::LeftButton, {});
    QApplication::sendEvent(&button, &move);
  };
  QTest::mousePress(&button, Qt::LeftButton, {}, {20, 20});
  drag_to({40, 20});
  EXPECT_TRUE(button.is_held());
  drag_to({40, 90});
  EXPECT_FALSE(button.is_held());
  drag_to({40, 20});
  QTest::qWait(HoldButton::hold_ms + 200);
  EXPECT_EQ(orders, 0);
  QTest::mouseRelease(&button, Qt::LeftButton, {}, {40, 20});
  QTest::mousePress(&button, Qt::LeftButton, {}, {20, 20});
  QTest::qWait(HoldButton::hold_ms + 200);
  EXPECT_EQ(orders, 1);
}

}  // namespace
}  // namespace helicarm::gui

int main(int argc, char** argv) {
  QStandardPaths::setTestModeEnabled(true);
  helicarm::gui::keep_memory_flat();
  helicarm::gui::WatchedApplication app(argc, argv);
  QApplication::setOrganizationName("helicarm");
  QApplication::setApplicationName("helicarm-gui-test");
  helicarm::gui::style::apply({});
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
