// SPDX-License-Identifier: Apache-2.0
#include <QDoubleSpinBox>
#include <QToolButton>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/plan_tables.h"
#include "gui/window/register_page.h"
#include "gui/window/window_test.h"
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

ApplicationState with_registration(const case_registration::RegisteredModel& model) {
  ApplicationState state;
  state.registration = std::make_shared<const case_registration::CaseRegistration>(
      case_registration::CaseRegistration{.failure = {}, .warnings = {}, .models = {model}, .loaded = {}});
  return state;
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
