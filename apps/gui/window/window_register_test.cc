// SPDX-License-Identifier: Apache-2.0
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QToolButton>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/model_marks.h"
#include "gui/window/plan_tables.h"
#include "gui/window/register_page.h"
#include "gui/window/registration_reasons.h"
#include "gui/window/window_test.h"
#include "gui/window/work_bar.h"
#include "gui/xray/mark_painter.h"

namespace helicarm::gui {
namespace {

TEST_F(Window, AModelIsRegisteredAndMovedByHand) {
  write_case_with_model(folder_ / "case");
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  auto* scene = find<SceneView>("scene");
  const QImage without = scene->grab().toImage();
  EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());  // opens there
  EXPECT_EQ(find<QTableWidget>("modelTable")->item(0, 1)->text(), "not registered");
  screenshot("register-first");
  click("registerModels");
  ASSERT_TRUE(state().busy);
  for (QAction* action : window_->findChildren<QAction*>())
    if (action->shortcut() == QKeySequence("Ctrl+E")) action->trigger();
  emit window_->controller().changed();  // a step of the registration
  EXPECT_TRUE(window_->statusBar()->currentMessage().contains("Nothing is exported during other work"));
  EXPECT_EQ(window_->findChild<QDialog*>("exportDialog"), nullptr);
  ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
  EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());
  EXPECT_NE(card(Phase::registration).status, StepStatus::refused)
      << card(Phase::registration).why.toStdString();
  auto* models = find<QTableWidget>("modelTable");
  ASSERT_EQ(models->rowCount(), 1);
  EXPECT_EQ(models->item(0, 0)->text(), "bone");
  EXPECT_EQ(find<QTableWidget>("modelPointTable")->rowCount(), 2);
  auto* slices = find<QLabel>("tunnelSlices");
  EXPECT_EQ(find<QTableWidget>("modelTunnelTable")->rowCount(), 1);
  EXPECT_TRUE(slices->isVisible());
  EXPECT_GT(slices->pixmap(Qt::ReturnByValue).width(), 100);
  ASSERT_TRUE(wait("the X-ray is shown", [&] { return !window_->xray(0).is_computing(); }));
  const auto pixels_apart = [](const QImage& a, const QImage& b) {
    int apart = 0;
    for (int y = 0; y < a.height(); ++y)
      for (int x = 0; x < a.width(); ++x) apart += a.pixel(x, y) != b.pixel(x, y);
    return apart;
  };
  QImage in_scene;
  ASSERT_TRUE(wait("the model is in the scene", [&] {
    in_scene = scene->grab().toImage();
    return pixels_apart(in_scene, without) > 5000;  // more than its labels
  }));
  screenshot("register");

  const auto first = state().registration;
  const QImage registered = window_->xray(0).image_with_marks();
  EXPECT_FALSE(find("registerFromHere")->isEnabled());
  find<QDoubleSpinBox>("shiftX")->setValue(4);
  EXPECT_GT(pixels_apart(scene->grab().toImage(), in_scene), 100);  // at once
  find<QDoubleSpinBox>("shiftY")->setValue(4);
  ASSERT_TRUE(wait("the outline has moved",
                   [&] { return state().nudged && state().nudged->outlines != first->models[0].outlines; }));
  EXPECT_NE(window_->xray(0).image_with_marks(), registered);
  screenshot("register-by-hand");
  EXPECT_TRUE(find("registerFromHere")->isEnabled());
  EXPECT_EQ(card(Phase::registration).status, StepStatus::stale);
  EXPECT_EQ(models->item(0, 1)->text(), "moved by hand");
  EXPECT_FALSE(slices->isVisible());
  EXPECT_EQ(find<QTableWidget>("modelTunnelTable")->rowCount(), 0);
  auto* field = find<QDoubleSpinBox>("shiftX");
  field->setFocus();
  QTest::keyClick(field, Qt::Key_E, Qt::ControlModifier);
  QTest::keyClick(field, Qt::Key_Z, Qt::ControlModifier);
  QTest::keyClick(field, Qt::Key_U, Qt::ControlModifier);
  EXPECT_EQ(field->value(), 4);
  ASSERT_TRUE(wait("the export is asked for",
                   [&] { return window_->findChild<QDialog*>("exportDialog") != nullptr; }));
  window_->findChild<QDialog*>("exportDialog")->close();

  QTest::mouseClick(window_->strip().button(Phase::plan), Qt::LeftButton);
  auto* tunnels = find<QTableWidget>("tunnelTable");
  EXPECT_TRUE(tunnels->isVisible());
  ASSERT_EQ(tunnels->rowCount(), 1);
  EXPECT_EQ(tunnels->item(0, 0)->text(), "tunnel");
  EXPECT_EQ(tunnels->item(0, 1)->text(), "plan of bone, out of date");
  EXPECT_EQ(tunnels->item(0, 3)->text(), "–");
  EXPECT_EQ(card(Phase::plan).status, StepStatus::stale);
  for (const char* axis : {"shiftX", "shiftY"}) find<QDoubleSpinBox>(axis)->setValue(0);
  EXPECT_EQ(tunnels->item(0, 1)->text(), "plan of bone");
  EXPECT_NE(card(Phase::plan).status, StepStatus::stale);
  EXPECT_TRUE(find<QLabel>("tunnelsOfModels")->isVisible());
  EXPECT_EQ(tunnels->item(0, 2)->text(), "20.00");
  auto* ends = find<QTableWidget>("endTable");
  const auto found = ends->findItems("tunnel_end", Qt::MatchExactly);
  ASSERT_EQ(found.size(), 1);
  EXPECT_EQ(ends->item(found[0]->row(), 1)->text(), "plan of bone");
  ends->setCurrentItem(found[0]);
  EXPECT_FALSE(find("deletePick")->isEnabled());  // it is not picked
  screenshot("plan-of-model");
}

TEST_F(Window, AModelIsPlacedByHandBeforeItsFirstRegistration) {
  const geometry::RigidTransform truth = write_case_with_model(folder_ / "case");
  Json json = read_json(folder_ / "case/case.json").value();
  json["models"][0].erase("start");
  ASSERT_TRUE(write_file(folder_ / "case/case.json", to_text(json)));
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  EXPECT_FALSE(find<QDoubleSpinBox>("shiftX")->isEnabled());
  click("placeModels");
  ASSERT_TRUE(wait("the model is displayed", [&] { return state().at_starts && !state().busy; }));
  EXPECT_FALSE(find("placeModels")->isVisible());
  EXPECT_FALSE(outlines_of(state(), 0).at(0).dots.empty());
  screenshot("place-by-hand");
  find<QDoubleSpinBox>("shiftX")->setValue(4);
  ASSERT_TRUE(state().nudged);
  EXPECT_EQ(find<QTableWidget>("modelTable")->item(0, 1)->text(), "placed by hand");
  const registration::Registration start = state().at_starts->models[0].registration;
  registration::RigidStep beside = registration::step_about(start.world_from_model, truth, start.centre);
  beside[4] += 3;
  window_->controller().nudge(0, beside);
  ASSERT_TRUE(wait("the outline has moved",
                   [&] { return state().nudged->outlines != state().at_starts->models[0].outlines; }));
  screenshot("placed-by-hand");
  click("registerFromHere");
  ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
  EXPECT_EQ(state().starts_by_hand.size(), 1u);
  const registration::Registration& found = state().registration->models[0].registration;
  EXPECT_FALSE(found.anywhere);
  EXPECT_LT((found.world_from_model.translation - truth.translation).norm(), 1);
}

TEST_F(Window, SeveralModelsArePlacedByHandBeforeTheFirstRegistration) {
  write_case_with_model(folder_ / "case");
  Json json = read_json(folder_ / "case/case.json").value();
  json["models"].push_back(json["models"][0]);
  json["models"][1]["name"] = "again";
  json["models"][1].erase("plan");
  json["models"].push_back({{"name", "points"}, {"start", {{"landmarks", "points.csv"}}}});
  ASSERT_TRUE(write_file(folder_ / "case/points.csv", "name,x_mm,y_mm,z_mm\na,0,0,0\nb,9,0,0\nc,0,9,0\n"));
  ASSERT_TRUE(write_file(folder_ / "case/case.json", to_text(json)));
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  click("placeModels");
  ASSERT_TRUE(wait("the models are displayed", [&] { return state().at_starts && !state().busy; }));
  ASSERT_EQ(models_of(state()).size(), 2u);  // the points have no start
  for (const ModelShape& shape : models_of(state()))
    EXPECT_EQ(shape.state, ModelShape::State::not_registered);
  auto* chosen = find<QComboBox>("nudgedModel");
  auto* shift = find<QDoubleSpinBox>("shiftX");
  shift->setValue(4);
  chosen->setCurrentIndex(1);
  EXPECT_EQ(chosen->currentIndex(), 1);
  EXPECT_EQ(shift->value(), 0);
  EXPECT_TRUE(find("registerFromHere")->isEnabled());
  shift->setValue(6);
  const auto* models = find<QTableWidget>("modelTable");
  for (const int model : {0, 1}) EXPECT_EQ(models->item(model, 1)->text(), "placed by hand");
  EXPECT_EQ(models->item(2, 1)->text(), "not registered");
  for (const ModelShape& shape : models_of(state())) EXPECT_EQ(shape.state, ModelShape::State::by_hand);
  ASSERT_TRUE(wait("both outlines follow", [&] {
    return !outlines_of(state(), 0).at(0).dots.empty() &&
           state().nudged->outlines != state().at_starts->models[1].outlines;
  }));
  screenshot("place-several-by-hand");
  chosen->setCurrentIndex(2);
  EXPECT_FALSE(shift->isEnabled());
  chosen->setCurrentIndex(0);
  EXPECT_TRUE(shift->isEnabled());
  EXPECT_TRUE(find("registerFromHere")->isEnabled());
  EXPECT_EQ(state().starts_by_hand.size(), 2u);
}

TEST_F(Window, AReplayShowsTheModelsAsTheyWereRegistered) {
  open_rehearsal({.by_ct = true});
  shoot_both();
  click("registerModels");
  ASSERT_TRUE(wait("the models are registered", [&] { return state().registration && !state().busy; }));
  click("confirmRegistration");
  ASSERT_TRUE(wait("the registration is confirmed", [&] { return state().is_confirmed && !state().busy; }));
  const auto rows = [&](const char* name) {
    QStringList cells;
    const auto* table = find<QTableWidget>(name);
    for (int row = 0; row < table->rowCount(); ++row)
      for (int column = 0; column < table->columnCount(); ++column)
        cells << (table->item(row, column) ? table->item(row, column)->text() : QString());
    return cells;
  };
  const QStringList models = rows("modelTable"), tunnels = rows("modelTunnelTable");
  const QString figure = card(Phase::registration).figure, plan = card(Phase::plan).figure;
  const auto outlines = outlines_of(state(), 0);

  window_->open_paths({state().folder});
  auto* replay = window_->findChild<ReplayPanel*>();
  ASSERT_TRUE(replay->timeline());
  replay->set_moment(int(replay->timeline()->moments.size()) - 1);
  replay->set_moment(0);  // while it is opened
  ASSERT_TRUE(wait("the recorded case is shown", [&] { return state().is_replayed && !state().busy; }));
  EXPECT_FALSE(state().registration);
  replay->set_moment(int(replay->timeline()->moments.size()) - 1);
  ASSERT_TRUE(wait("the recorded registration is shown",
                   [&] { return state().is_replayed && state().registration && !state().busy; }));
  EXPECT_EQ(rows("modelTable"), models);
  EXPECT_EQ(rows("modelTunnelTable"), tunnels);
  EXPECT_EQ(card(Phase::registration).figure, figure);
  EXPECT_EQ(card(Phase::plan).figure, plan);
  ASSERT_EQ(outlines_of(state(), 0).size(), outlines.size());
  EXPECT_EQ(outlines_of(state(), 0)[0].dots, outlines[0].dots);
  EXPECT_EQ(outlines_of(state(), 0)[0].tunnels.size(), 1u);
  EXPECT_FALSE(find("registerModels")->isEnabled());
  QTest::mouseClick(window_->strip().button(Phase::registration), Qt::LeftButton);
  screenshot("replay-register");
  QTest::mouseClick(window_->strip().button(Phase::plan), Qt::LeftButton);
  screenshot("replay-plan");
  replay->set_moment(0);
  EXPECT_FALSE(state().registration);
  EXPECT_EQ(card(Phase::plan).why, "no model is registered at this moment");
  EXPECT_EQ(card(Phase::navigate).why, "no robot is registered at this moment");
  screenshot("replay-before");
}

TEST_F(Window, AModelThatIsRefusedOffersItsBestPosesAsImages) {
  write_case_with_model(folder_ / "case");
  std::string ct = to_nrrd(bone_in_tissue());
  const std::string along = "space directions: (1.2,", mirrored = "space directions: (-1.2,";
  ct.replace(ct.find(along), along.size(), mirrored);
  ASSERT_TRUE(write_file(folder_ / "case/ct.nrrd", ct));
  Json json = read_json(folder_ / "case/case.json").value();
  json["models"][0].erase("start");
  json["models"][0].erase("plan");
  ASSERT_TRUE(write_file(folder_ / "case/case.json", to_text(json)));
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  EXPECT_FALSE(find<QWidget>("poseImages")->isVisible());
  click("registerModels");
  ASSERT_TRUE(wait("the search has ended", [&] { return state().registration && !state().busy; }));
  const registration::Registration found = state().registration->models[0].registration;
  ASSERT_TRUE(found.failure);
  ASSERT_FALSE(found.alternatives.empty());
  EXPECT_TRUE(find<QWidget>("poseImages")->isVisible());
  EXPECT_TRUE(find<QToolButton>("pose0")->isChecked());
  screenshot("register-alternatives");
  screenshot("register-alternatives-images", find<QWidget>("poseImages"));
  find<QToolButton>("pose1")->click();
  ASSERT_TRUE(state().nudged);
  EXPECT_LT(
      (state().nudged->world_from_model.matrix() - found.alternatives[0].world_from_model.matrix()).norm(),
      1e-9);
  EXPECT_TRUE(find<QToolButton>("pose1")->isChecked());
  EXPECT_FALSE(find<QToolButton>("pose0")->isChecked());
  EXPECT_TRUE(find("registerFromHere")->isEnabled());
  find<QDoubleSpinBox>("shiftX")->setValue(find<QDoubleSpinBox>("shiftX")->value() + 1);
  EXPECT_FALSE(find<QToolButton>("pose1")->isChecked());
  find<QToolButton>("pose0")->click();
  EXPECT_FALSE(state().nudged);
}

TEST_F(Window, ACaseWithoutModelsHasNoRegisterStep) {
  EXPECT_FALSE(window_->strip().button(Phase::registration)->isVisible());
  EXPECT_FALSE(find<QTableWidget>("tunnelTable")->isVisible());
}

TEST(WorkBar, ShowsTheShareFromWhereOneIsStatedAndNeverLess) {
  WorkBar bar;
  const auto shown = [&](const std::optional<std::string>& doing) {
    bar.show_work(doing);
    return bar.maximum() == 0 ? -1 : bar.value();
  };
  EXPECT_EQ(shown("reading the models"), -1);
  EXPECT_EQ(shown("femur: search, 40 %"), 40);
  EXPECT_EQ(shown("femur: mirror image"), 40);
  EXPECT_EQ(shown("femur: mirror image, 30 %"), 40);
  EXPECT_EQ(shown("cancelling: femur: mirror image, 45 %"), 45);
  EXPECT_EQ(shown({}), -1);
  EXPECT_EQ(shown("measuring"), -1);
  EXPECT_EQ(shown("femur: search, 1 %"), 1);
}

ApplicationState with_registration(const case_registration::RegisteredModel& model) {
  ApplicationState state;
  state.registration = std::make_shared<const case_registration::CaseRegistration>(
      case_registration::CaseRegistration{.failure = {}, .warnings = {}, .models = {model}, .loaded = {}});
  return state;
}

TEST(RegisteredModels, OneRefusedFromAPoseByHandIsOfferedASearchWithoutIt) {
  case_registration::RegisteredModel model;
  model.registration.name = "femur";
  model.registration.failure = Failure{Reason::wrong_model, "femur: another bone", {}, {}};
  ApplicationState state = with_registration(model);
  state.models = {{.name = "femur"}};
  EXPECT_FALSE(reasons_of(state).contains("Register models"));
  state.starts_by_hand = {{"femur", {}}};
  EXPECT_TRUE(reasons_of(state).contains("\"Register models\" forgets that pose and searches everywhere"));
  state.models[0].landmarks = "points.csv";
  EXPECT_TRUE(reasons_of(state).contains("\"Register models\" forgets that pose and begins at the start"));
  model.registration.failure.reset();
  state.registration = with_registration(model).registration;
  EXPECT_FALSE(reasons_of(state).contains("Register models"));
}

TEST(RegisteredModels, RefusedOneHasNoTunnelsAndNoPointsInTheImages) {
  case_registration::RegisteredModel model;
  model.registration.name = "femur";
  model.registration.covariance.setIdentity();
  model.points.resize(2);
  model.points[1].place.in_calibrator = {0, 3, 4};
  model.points[1].place.covariance_in_calibrator.setIdentity();
  model.tunnels.push_back({"tunnel", {}, {}, {}, 5});
  model.tunnel_ends.push_back({0, 1});
  geometry::View view;
  view.intrinsics = {1000, 1000, 100, 100, 0};
  view.camera_from_world.translation = {0, 0, 500};
  model.views = {view};
  model.outlines = {{{1, 1}}};
  const auto rows = plan_tunnels(with_registration(model));
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_DOUBLE_EQ(rows[0].length_mm, 5);
  EXPECT_EQ(rows[0].start_95_mm, 0);
  EXPECT_NEAR(rows[0].end_95_mm, 2.79, 0.01);
  EXPECT_EQ(outlines_of(with_registration(model), 0)[0].points.size(), 2u);
  ASSERT_EQ(outlines_of(with_registration(model), 0)[0].tunnels.size(), 1u);
  EXPECT_FALSE(outlines_of(with_registration(model), 0)[0].tunnels[0].warns);
  registration::BoneCheck thin{.diameter_mm = 3, .required_mm = 2, .bridge_mm = 1, .drilled_sigma_mm = 0.1};
  thin.entry = Eigen::Vector3d::Zero();
  model.bone_checks = {thin};
  EXPECT_EQ(outlines_of(with_registration(model), 0)[0].tunnels[0].warns, ink::thin);
  model.bone_checks[0]->bridge_mm = -1;
  EXPECT_EQ(outlines_of(with_registration(model), 0)[0].tunnels[0].warns, ink::breach);
  EXPECT_EQ(models_of(with_registration(model)).size(), 1u);

  model.registration.failure = Failure{Reason::wrong_model, "femur: another bone", {}, {}};
  EXPECT_TRUE(plan_tunnels(with_registration(model)).empty());
  const auto outlines = outlines_of(with_registration(model), 0);
  EXPECT_TRUE(outlines[0].points.empty());
  EXPECT_EQ(outlines[0].dots.size(), 1u);
}

}  // namespace
}  // namespace helicarm::gui
