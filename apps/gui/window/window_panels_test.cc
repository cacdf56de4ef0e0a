// SPDX-License-Identifier: Apache-2.0
// Panels of the scene's objects and of the points; a model dragged by its handle.
#include <QAction>
#include <QCheckBox>
#include <QDockWidget>
#include <QDoubleSpinBox>
#include <QSlider>
#include <QTableWidget>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/points_panel.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace {

class WindowPanels : public Window {
 protected:
  void open_tunnels() {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    ASSERT_TRUE(simulation::write_case(folder_ / "tunnels", simulation::simulate_case(options).value()));
    window_->open_paths({folder_ / "tunnels"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  }
  void open_and_register() {
    write_case_with_model(folder_ / "model");
    window_->open_paths({folder_ / "model"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
    click("registerModels");
    ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
    ASSERT_TRUE(wait("the X-ray is shown", [&] { return !window_->xray(0).is_computing(); }));
  }
  static void drag(QWidget& widget, const QPoint& from, const QPoint& to) {
    QTest::mousePress(&widget, Qt::LeftButton, {}, from);
    for (const QPoint& at : {from + (to - from) / 2, to}) {
      QMouseEvent move(QEvent::MouseMove, at, widget.mapToGlobal(QPointF(at)), Qt::NoButton, Qt::LeftButton,
                       {});
      QApplication::sendEvent(&widget, &move);
    }
    QTest::mouseRelease(&widget, Qt::LeftButton, {}, to);
  }
  QPoint handle_in(std::size_t view) {
    const case_registration::RegisteredModel& model = state().registration->models[0];
    Eigen::Vector3d centre = model.registration.centre;
    if (state().nudged) centre += state().nudged->step.tail<3>();
    const Eigen::Vector2d raw =
        state().result->views[view].rectification->map.raw_from_rectified(model.views[view].project(centre));
    return window_->xray(view).place_of({raw.x(), raw.y()}).value().toPoint();
  }
  QAction* undo() {
    for (QAction* action : window_->findChildren<QAction*>())
      if (action->shortcut() == QKeySequence(QKeySequence::Undo)) return action;
    return nullptr;
  }
};

TEST_F(WindowPanels, AModelIsDraggedInTheImageAndInTheScene) {
  ASSERT_NO_FATAL_FAILURE(open_and_register());
  const QPoint from = handle_in(0);
  drag(window_->xray(0), from, from + QPoint(24, 0));
  ASSERT_TRUE(state().nudged);
  const registration::RigidStep shifted = state().nudged->step;
  EXPECT_TRUE(shifted.head<3>().isZero());
  EXPECT_GT(shifted.tail<3>().norm(), 1);
  EXPECT_NEAR((handle_in(0) - from).x(), 24, 2);
  EXPECT_NEAR(find<QDoubleSpinBox>("shiftX")->value(), shifted[3], 0.01);
  EXPECT_EQ(card(Phase::registration).status, StepStatus::stale);
  ASSERT_NE(undo(), nullptr);
  EXPECT_EQ(undo()->text(), "&Undo: move of bone");

  ASSERT_TRUE(window_->scene().handle_place());
  const QPoint in_scene = window_->scene().handle_place()->toPoint() + QPoint(int(handle_radius), 0);
  drag(window_->scene(), in_scene, in_scene + QPoint(-10, 30));
  EXPECT_GT(state().nudged->step.head<3>().norm(), 0.1);
  EXPECT_TRUE(state().nudged->step.tail<3>().isApprox(shifted.tail<3>()));

  undo()->trigger();
  ASSERT_TRUE(state().nudged);
  EXPECT_TRUE(state().nudged->step.isApprox(shifted));
  undo()->trigger();
  EXPECT_FALSE(state().nudged);
  EXPECT_EQ(find<QDoubleSpinBox>("shiftX")->value(), 0);
  EXPECT_EQ(handle_in(0), from);
  window_->strip().chosen(Phase::plan);
  EXPECT_FALSE(window_->scene().handle_place());
}

TEST_F(WindowPanels, UndoAndRedoOfARegistrationOpenItsPage) {
  ASSERT_NO_FATAL_FAILURE(open_and_register());
  for (const bool undoes : {true, false}) {
    window_->strip().chosen(Phase::plan);
    undoes ? window_->controller().undo() : window_->controller().redo();
    EXPECT_EQ(bool(state().registration), !undoes);
    EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());
  }
}

TEST_F(WindowPanels, EachObjectOfTheSceneIsHiddenAndMadeTransparent) {
  ASSERT_NO_FATAL_FAILURE(open_and_register());
  find<QDockWidget>("objectsDock")->show();
  find<QSlider>("opacity:Model bone")->setValue(90);
  EXPECT_NEAR(window_->scene().opacity().of_model("bone"), 0.9, 1e-9);
  find<QCheckBox>("shown:Model bone")->click();
  EXPECT_TRUE(window_->scene().hidden_models().contains("bone"));
  EXPECT_FALSE(find<QSlider>("opacity:Model bone")->isEnabled());
  find<QCheckBox>("shown:Calibrator")->click();
  EXPECT_FALSE(window_->scene().parts() & ScenePart::calibrator);
  window_->scene().show_parts(all_parts);  // by the menu
  EXPECT_TRUE(find<QCheckBox>("shown:Calibrator")->isChecked());
}

TEST_F(WindowPanels, TheSceneMovesIntoAPanelOfItsOwnAndBack) {
  auto* apart = find<QAction>("sceneApart");
  auto* dock = find<QDockWidget>("sceneDock");
  EXPECT_FALSE(dock->isVisible());
  apart->trigger();
  EXPECT_TRUE(dock->isVisible());
  EXPECT_EQ(window_->scene().window(), dock);
  EXPECT_TRUE(window_->scene().isVisible());
  dock->close();
  EXPECT_FALSE(apart->isChecked());
  EXPECT_EQ(window_->scene().window(), window_.get());
  EXPECT_TRUE(window_->scene().isVisible());
}

TEST_F(WindowPanels, PointsAreListedByViewsAndChosenThere) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  auto* table = find<QTableWidget>("pointTable");
  find<QDockWidget>("pointsDock")->show();
  ASSERT_EQ(table->columnCount(), 4);
  const auto row = table->findItems("FE", Qt::MatchExactly).at(0)->row();
  EXPECT_THAT(table->item(row, 2)->text().toStdString(), HasSubstr(" px"));
  EXPECT_EQ(point_in_views(state(), "FE")[1].state, PointInView::State::located);
  pipeline::Pick pick = *pick_of(state(), "FE", "AP");
  pick.uv_raw += Eigen::Vector2d(30, -30);
  window_->controller().pick(pick);
  EXPECT_EQ(table->item(row, 1)->text(), "–");  // at once
  EXPECT_THAT(table->item(row, 2)->text().toStdString(), HasSubstr("no pick"));
  EXPECT_THAT(table->item(row, 2)->toolTip().toStdString(), HasSubstr("no ball"));
  ASSERT_TRUE(wait_idle());
  emit table->cellClicked(row, 3);
  EXPECT_EQ(find<QTableWidget>("endTable")->currentItem()->text(), "FE");
  EXPECT_TRUE(window_->xrays().panel_of(1));
}

}  // namespace
}  // namespace helicarm::gui
