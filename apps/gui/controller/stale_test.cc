// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/stale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/controller/controller.h"
#include "gui/controller/steps.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {
namespace {

using testing::HasSubstr;

pipeline::Pick clicked(const std::string& point, const std::string& view, double u = 10) {
  pipeline::Pick pick;
  pick.name = point;
  pick.view = view;
  pick.uv_raw = {u, 20};
  return pick;
}

/// A measured case with a point P, and a registered model "bone" with a planned tunnel, registered by the
/// landmark P.
ApplicationState measured_case() {
  ApplicationState state;
  state.source = Source::files;
  state.views = {"AP", "LAT"};
  state.measured = state.has_models = true;
  state.landmarks = {"P"};
  state.picks = state.measured_picks = state.registered_picks = {clicked("P", "AP"), clicked("P", "LAT")};
  pipeline::Result result;
  result.views.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    result.views[i].name = state.views[i];
    result.views[i].rectification.emplace();
    result.views[i].found.emplace();
    result.views[i].calibrated.emplace();
  }
  pipeline::PointResult point{"P", localization::PointSource::pick, {}, {}, guidance::PointInFrames{}, 0, {}};
  point.place->covariance_in_calibrator.setIdentity();
  result.points = {point};
  state.result = std::make_shared<const pipeline::Result>(result);
  case_registration::RegisteredModel model;
  model.registration.name = "bone";
  model.registration.decision = registration::Decision::accept;
  model.registration.covariance.setIdentity();
  model.points.resize(2);
  for (auto& planned : model.points) planned.place.covariance_in_calibrator.setIdentity();
  model.tunnels.push_back({"tunnel", {}, {}, {}, 5});
  model.tunnel_ends.push_back({0, 1});
  model.used_landmarks = {{"P", {}, {}}};
  state.registration = std::make_shared<const case_registration::CaseRegistration>(
      case_registration::CaseRegistration{.failure = {}, .warnings = {}, .models = {model}, .loaded = {}});
  return state;
}

StepStatus status(const ApplicationState& state, Phase phase) {
  return steps_of(state)[std::size_t(phase)].status;
}

/// The steps that hold no figure of the present inputs.
std::vector<Phase> out_of_date(const ApplicationState& state) {
  std::vector<Phase> steps;
  for (const StepCard& card : steps_of(state))
    if (card.status == StepStatus::stale) {
      EXPECT_TRUE(card.figure.isEmpty()) << card.figure.toStdString();
      EXPECT_FALSE(card.why.isEmpty());
      steps.push_back(card.phase);
    }
  return steps;
}

TEST(Stale, NothingIsWhereNothingChanged) {
  const ApplicationState state = measured_case();
  EXPECT_TRUE(out_of_date(state).empty());
  EXPECT_EQ(status(state, Phase::plan), StepStatus::good);
  EXPECT_EQ(status(state, Phase::registration), StepStatus::good);
}

TEST(Stale, APickOfALandmarkPutsPlanAndRegistrationOutOfDate) {
  ApplicationState state = measured_case();
  state.picks[0].uv_raw.x() += 1;
  EXPECT_EQ(out_of_date(state), (std::vector{Phase::plan, Phase::registration}));
  state.measured_picks = state.picks;  // measured again, but not registered
  EXPECT_EQ(out_of_date(state), (std::vector{Phase::plan, Phase::registration}));
  state.registered_picks = state.picks;
  EXPECT_TRUE(out_of_date(state).empty());
}

TEST(Stale, APickThatNoModelUsesLeavesTheRegistration) {
  ApplicationState state = measured_case();
  for (const char* view : {"AP", "LAT"}) state.picks.push_back(clicked("Q", view));
  EXPECT_EQ(out_of_date(state), std::vector{Phase::plan});
}

TEST(Stale, AModelMovedByHandPutsPlanAndRegistrationOutOfDate) {
  ApplicationState state = measured_case();
  state.nudged.emplace();
  EXPECT_EQ(out_of_date(state), (std::vector{Phase::plan, Phase::registration}));
  EXPECT_THAT(stale(state, Phase::registration).toStdString(), HasSubstr("bone is moved by hand"));
}

TEST(Stale, OtherSettingsPutEveryMeasuredStepOutOfDate) {
  ApplicationState state = measured_case();
  state.has_other_options = true;
  EXPECT_EQ(out_of_date(state),
            (std::vector{Phase::rectify, Phase::calibrate, Phase::plan, Phase::registration}));
}

TEST(Stale, AMovedModelIsExportedAsRefusedWithoutItsPlan) {
  ApplicationState state = measured_case();
  EXPECT_TRUE(lacks_of_export(state).isEmpty()) << lacks_of_export(state).join("; ").toStdString();
  state.nudged.emplace();
  const auto model = present_registration(state).models.at(0);
  EXPECT_EQ(model.registration.decision, registration::Decision::refuse);
  EXPECT_EQ(model.registration.failure->reason, Reason::plan_stale);
  EXPECT_TRUE(model.points.empty() && model.tunnels.empty() && model.tunnel_ends.empty());
  ASSERT_EQ(lacks_of_export(state).size(), 1);
  EXPECT_THAT(lacks_of_export(state).front().toStdString(), HasSubstr("moved by hand"));
}

TEST(Stale, AnExportNamesEndsThatFailedOrAreMissing) {
  ApplicationState state = measured_case();
  state.tunnels = {{"femur", "femur", "FS", "FE"}};
  state.picks.push_back(clicked("FE", "AP"));
  state.measured_picks = state.picks;
  state.failed_picks = {{state.picks[0], Failure{Reason::target_not_found, "no ball", "AP", {}}}};
  const auto lacks = lacks_of_export(state).join("; ").toStdString();
  EXPECT_THAT(lacks, HasSubstr("FS is not picked"));
  EXPECT_THAT(lacks, HasSubstr("FE is picked in AP only"));
  EXPECT_THAT(lacks, HasSubstr("P: AP: no ball"));
}

TEST(Stale, AnExportIsOutOfDateAfterAChange) {
  ApplicationState state = measured_case();
  state.has_models = false;
  EXPECT_EQ(steps_of(state)[std::size_t(Phase::verify)].why, "export the results (Ctrl+E)");
  state.exported = ExportRecord{"out", "12:00", {}, state.result, state.registration, state.picks};
  EXPECT_EQ(status(state, Phase::verify), StepStatus::good);
  EXPECT_EQ(steps_of(state)[std::size_t(Phase::verify)].figure, "exported at 12:00");
  state.picks[0].uv_raw.x() += 1;
  EXPECT_FALSE(is_exported(state));
  EXPECT_NE(status(state, Phase::verify), StepStatus::good);
}

TEST(Steps, AFailedPickIsStillToBePicked) {
  ApplicationState state = measured_case();
  state.failed_picks = {{state.picks[0], Failure{Reason::target_not_found, "no ball", "AP", {}}}};
  const auto wanted = next_landmark(state);
  ASSERT_TRUE(wanted && wanted->failed);
  EXPECT_EQ(wanted->point + " " + wanted->view, "P AP");
  EXPECT_EQ(status(state, Phase::plan), StepStatus::warning);
  EXPECT_THAT(steps_of(state)[std::size_t(Phase::plan)].why.toStdString(), HasSubstr("no ball"));
}

TEST(Steps, APlanWithoutPointsNamesTheNextAction) {
  ApplicationState state = measured_case();
  state.landmarks.clear();
  state.picks.clear();
  state.measured_picks.clear();
  state.registration.reset();
  pipeline::Result without = *state.result;
  without.points.clear();
  state.result = std::make_shared<const pipeline::Result>(without);
  EXPECT_EQ(steps_of(state)[std::size_t(Phase::plan)].why, "register the models (Alt+7)");
  state.has_models = false;
  EXPECT_EQ(steps_of(state)[std::size_t(Phase::plan)].why, "add a landmark to locate a point");
}

TEST(Steps, ACancelledRegistrationIsNoRefusal) {
  ApplicationState state = measured_case();
  state.registration.reset();
  state.refusals[Phase::registration] = {Reason::interrupted, "cancelled"};
  EXPECT_EQ(status(state, Phase::registration), StepStatus::waiting);
  EXPECT_EQ(steps_of(state)[std::size_t(Phase::registration)].why, "cancelled");
}

TEST(Steps, AHiddenMarkerWarnsWhereItIsNeeded) {
  ApplicationState state = measured_case();
  LiveState live;
  live.indicators = {{"femur", Light::red, "4 s", "not visible", {}}};
  const auto card = [&](Phase phase) {
    return with_devices(steps_of(state), state, live)[std::size_t(phase)];
  };
  EXPECT_EQ(card(Phase::navigate).status, StepStatus::warning);
  EXPECT_EQ(card(Phase::navigate).why, "femur: not visible");
  EXPECT_NE(card(Phase::acquire).status, StepStatus::warning);
  state.measured = false;
  EXPECT_EQ(card(Phase::acquire).status, StepStatus::warning);
}

}  // namespace
}  // namespace helicarm::gui
