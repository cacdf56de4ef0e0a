// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include <gtest/gtest.h>

#include "gui/controller/controller_fixtures_test.h"
#include "gui/controller/equipment.h"
#include "gui/controller/steps.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {
namespace fs = std::filesystem;
namespace {

class ControllerRegistration : public ControllerWithModel {
 protected:
  ControllerRegistration() {
    controller_->open_case(written_->path(), false);
    idle();
  }

  StepCard card() { return steps_of(state())[std::size_t(Phase::registration)]; }
  const registration::Registration& found() { return state().registration->models.at(0).registration; }
};

TEST_F(ControllerRegistration, RegistersTheModelsAndStartsFromANudgedPose) {
  ASSERT_TRUE(state().measured);
  EXPECT_TRUE(card().is_offered);
  ASSERT_TRUE(register_models());
  EXPECT_LT((found().world_from_model.translation - truth_.translation).norm(), 1);
  EXPECT_EQ(state().registration->models[0].points.size(), 2u);
  const auto first = state().registration;

  registration::RigidStep step = registration::RigidStep::Zero();
  step.tail<3>() << 3, 0, 0;
  controller_->nudge(0, step);
  ASSERT_TRUE(state().nudged);
  EXPECT_NEAR((state().nudged->world_from_model.translation - found().world_from_model.translation).norm(), 3,
              1e-9);
  ASSERT_TRUE(
      wait("the outlines follow", [&] { return state().nudged->outlines != first->models[0].outlines; }));
  EXPECT_EQ(state().nudged->outlines.size(), 2u);
  ASSERT_TRUE(register_models());
  EXPECT_FALSE(state().nudged);
  ASSERT_NE(state().registration, first);
  EXPECT_LT((found().world_from_model.translation - truth_.translation).norm(), 1);
}

TEST_F(ControllerRegistration, ExportsTheTunnelsOfTheModels) {
  ASSERT_TRUE(register_models());
  const TemporaryFolder out;
  controller_->export_to(out.path());
  ASSERT_TRUE(idle());
  const Json result = read_json(out.path() / "result.json").value();
  ASSERT_EQ(result["tunnels"].size(), 1u);
  EXPECT_EQ(result["tunnels"][0]["name"], "tunnel");
  const Json models = read_json(out.path() / "registration.json").value();
  Json tunnel = models["models"][0]["tunnels"][0];
  tunnel["model"] = "bone";
  EXPECT_EQ(nlohmann::json(result["tunnels"][0]), nlohmann::json(tunnel));  // keys in any order
  EXPECT_TRUE(fs::exists(out.path() / "registration" / "report.html"));
  // The images are DICOM files, the volume is none: a report without a registration, and nothing lacks.
  EXPECT_TRUE(fs::exists(out.path() / "measurements.dcm"));
  EXPECT_EQ(state().exported->lacks.filter("DICOM").size(), 0);
}

TEST_F(ControllerRegistration, AsksForNoPicksWhereModelsBringTheTunnels) {
  EXPECT_TRUE(state().tunnels.empty());
}

TEST_F(ControllerRegistration, ExportsAModelMovedByHandAsRefusedWithoutItsPlan) {
  ASSERT_TRUE(register_models());
  registration::RigidStep step = registration::RigidStep::Zero();
  step.tail<3>() << 5, 0, 0;
  controller_->nudge(0, step);
  EXPECT_EQ(card().status, StepStatus::stale);
  ASSERT_TRUE(wait("the outlines follow", [&] {
    return state().nudged && state().nudged->outlines != state().registration->models[0].outlines;
  }));
  const TemporaryFolder out;
  controller_->export_to(out.path());
  ASSERT_TRUE(idle());
  const Json models = read_json(out.path() / "registration.json").value();
  EXPECT_EQ(models["models"][0]["decision"], "refuse");
  EXPECT_EQ(models["models"][0]["failure"]["code"], "plan_stale");
  EXPECT_TRUE(models["models"][0]["tunnels"].empty());
  EXPECT_TRUE(read_json(out.path() / "result.json").value()["tunnels"].empty());
  ASSERT_TRUE(state().exported);
  EXPECT_TRUE(state().exported->lacks.join("; ").contains("moved by hand"));
}

TEST_F(ControllerRegistration, OtherSettingsMeasureTheCaseAgain) {
  ASSERT_TRUE(register_models());
  case_registration::RegisterOptions options;
  options.run.motion_sigma_mm = 0.5;
  const int before = state().measurements;
  controller_->set_options(options);
  EXPECT_TRUE(state().has_other_options);
  EXPECT_EQ(card().status, StepStatus::stale);
  ASSERT_TRUE(idle());
  EXPECT_FALSE(state().has_other_options);
  EXPECT_EQ(state().measurements, before + 1);
  EXPECT_FALSE(state().registration);
}

TEST_F(ControllerRegistration, AChangedFileOfTheCasePutsEveryStepOutOfDateUntilItIsReadAgain) {
  const TemporaryFolder own;
  write_case_with_model(own.path());
  controller_->open_case(own.path());
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().measured);
  Json json = read_json(own.path() / "case.json").value();
  json["notes"] = "changed";
  ASSERT_TRUE(write_file(own.path() / "case.json", to_text(json)));
  ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
  const auto status = [&](Phase phase) { return steps_of(state())[std::size_t(phase)].status; };
  for (const Phase phase : {Phase::acquire, Phase::rectify, Phase::calibrate})
    EXPECT_EQ(status(phase), StepStatus::stale);
  controller_->export_to(own.path() / "export");
  EXPECT_FALSE(state().busy);
  controller_->measure_again();
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  EXPECT_TRUE(state().changed_file.empty());
  EXPECT_EQ(status(Phase::calibrate), StepStatus::good);
}

TEST_F(ControllerRegistration, AnOwnCalibratorIsNotAskedForTheKneesTunnels) {
  const TemporaryFolder own;
  simulation::SimulationOptions options;
  options.kind = simulation::CaseKind::flat;
  options.size = 512;
  auto simulated = simulation::simulate_case(options).value();
  simulated.calibrator.name = "own object";
  ASSERT_TRUE(simulation::write_case(own.path(), simulated));
  ASSERT_TRUE(write_file(own.path() / "own.json", to_text(phantom::to_json(simulated.calibrator))));
  Json json = read_json(own.path() / "case.json").value();
  json["calibrator"] = "own.json";
  json.erase("picks");
  json.erase("tunnels");
  json.erase("tool_lines");
  ASSERT_TRUE(write_file(own.path() / "case.json", to_text(json)));
  controller_->open_case(own.path(), false);
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().result) << steps_of(state())[0].why.toStdString();
  EXPECT_TRUE(state().tunnels.empty());
}

TEST_F(ControllerRegistration, CancelEndsIt) {
  controller_->register_models();
  controller_->cancel();
  ASSERT_TRUE(idle());
  EXPECT_FALSE(state().registration);
  EXPECT_EQ(state().refusals.at(Phase::registration).reason, Reason::interrupted);
  EXPECT_EQ(card().status, StepStatus::waiting);
}

TEST_F(ControllerRegistration, CancelDuringTheSearchEndsIt) {
  Equipment equipment;
  equipment.the_case = pipeline::read_case(written_->path()).value();
  ASSERT_TRUE(measure(equipment, {}));
  std::vector<std::string> told;
  const auto done = gui::register_models(equipment, {}, {}, {}, [&](const std::string& step) {
    told.push_back(step);
    equipment.stopped = step == "bone: search";
  });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().reason, Reason::interrupted);
  EXPECT_EQ(told.back(), "bone: search");
}

TEST_F(ControllerRegistration, UndoTakesBackMovesLandmarksAndRegistrations) {
  ASSERT_TRUE(register_models());
  const auto first = state().registration;
  ASSERT_TRUE(first);
  registration::RigidStep step = registration::RigidStep::Zero();
  step[3] = 1;
  controller_->nudge(0, step);
  step[3] = 2;
  controller_->nudge(0, step, true);  // the same drag
  EXPECT_EQ(controller_->undoes(), "move of bone");
  controller_->nudge(0, step);  // is there
  controller_->add_landmark("epicondyle");
  EXPECT_EQ(controller_->undoes(), "landmark epicondyle");
  controller_->undo();
  EXPECT_TRUE(state().landmarks.empty());
  ASSERT_TRUE(state().nudged);
  controller_->undo();
  EXPECT_FALSE(state().nudged);
  EXPECT_EQ(controller_->redoes(), "move of bone");
  controller_->redo();
  ASSERT_TRUE(state().nudged);
  EXPECT_EQ(state().nudged->step, step);
  ASSERT_TRUE(register_models());
  ASSERT_NE(state().registration, first);
  EXPECT_FALSE(state().nudged);
  controller_->undo();
  EXPECT_EQ(state().registration, first);
  EXPECT_TRUE(state().nudged);
}

TEST_F(ControllerRegistration, UndoReturnsToNoRegistrationOfOtherViews) {
  ASSERT_TRUE(register_models());
  registration::RigidStep step = registration::RigidStep::Zero();
  step[3] = 1;
  controller_->nudge(0, step);
  case_registration::RegisterOptions options;
  options.run.motion_sigma_mm = 0.5;
  controller_->set_options(options);
  ASSERT_TRUE(idle());
  ASSERT_FALSE(state().registration);
  while (controller_->can_undo()) {
    controller_->undo();
    EXPECT_FALSE(state().registration);
    EXPECT_FALSE(state().nudged);
  }
}

TEST(Steps, RegistrationIsOfCasesWithModels) {
  EXPECT_FALSE(steps_of({})[std::size_t(Phase::registration)].is_offered);
}

StepCard card_of(const case_registration::RegisteredModel& model) {
  ApplicationState state;
  state.has_models = state.measured = true;
  state.result = std::make_shared<const pipeline::Result>();
  state.registration = std::make_shared<const case_registration::CaseRegistration>(
      case_registration::CaseRegistration{.failure = {}, .warnings = {}, .models = {model}, .loaded = {}});
  return steps_of(state)[std::size_t(Phase::registration)];
}

TEST(Steps, RegistrationShowsTheErrorOfItsWorstModel) {
  case_registration::RegisteredModel model;
  model.registration.covariance.setZero();
  model.registration.covariance.diagonal().setConstant(0.04);
  EXPECT_EQ(card_of(model).figure, "within 0.56 mm (95 %)");  // 0.2 sqrt(7.815)
  EXPECT_EQ(card_of(model).status, StepStatus::good);
}

TEST(Steps, ErrorsThatAreNotKnownAreStatedBesideTheLargestKnown) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(largest_error_words({0.25, 0.5}), "within 0.50 mm (95 %)");
  EXPECT_EQ(largest_error_words({0.5, unknown}), "within 0.50 mm (95 %), others not known");
  EXPECT_EQ(largest_error_words({unknown, 0.5}), "within 0.50 mm (95 %), others not known");
  EXPECT_EQ(largest_error_words({unknown}), "errors not known");
  case_registration::RegisteredModel model;
  model.points.resize(2);
  model.points[0].place.covariance_in_calibrator = 0.04 * Eigen::Matrix3d::Identity();
  model.points[1].place.covariance_in_calibrator.setConstant(unknown);
  EXPECT_EQ(card_of(model).figure, "within 0.56 mm (95 %), others not known");
}

TEST(Steps, RegistrationShowsWhyAModelIsRefused) {
  case_registration::RegisteredModel model;
  model.registration.failure = Failure{Reason::wrong_model, "femur: another bone", {}, {}};
  EXPECT_EQ(card_of(model).status, StepStatus::refused);
  EXPECT_EQ(card_of(model).why, "femur: another bone (wrong_model)");
}

}  // namespace
}  // namespace helicarm::gui
