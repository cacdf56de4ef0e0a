// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/controller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/controller/steps.h"

namespace helicarm::gui {
namespace {

using testing::HasSubstr;

ApplicationState state_with(std::vector<pipeline::ViewResult> views) {
  ApplicationState state;
  state.source = Source::files;
  state.views = {"AP", "LAT"};
  state.next_view = "LAT";
  state.tunnels = {{"femur", "femur", "FS", "FE"}};
  auto result = std::make_shared<pipeline::Result>();
  result->views = std::move(views);
  state.result = std::move(result);
  return state;
}

pipeline::ViewResult exposed(const std::string& name) {
  pipeline::ViewResult view;
  view.name = name;
  view.xray_image = std::make_shared<const xray::XrayImage>();
  return view;
}

pipeline::Pick pick(const std::string& name, const std::string& view) {
  pipeline::Pick made;
  made.name = name;
  made.view = view;
  return made;
}

const StepCard& card_of(const std::array<StepCard, phases.size()>& cards, Phase phase) {
  return cards[std::size_t(phase)];
}

TEST(Steps, WithoutASourceAllWait) {
  for (const StepCard& card : steps_of({})) EXPECT_EQ(card.status, StepStatus::waiting);
}

TEST(Steps, NameTheNextImage) {
  pipeline::ViewResult missing;
  missing.name = "LAT";
  const auto cards = steps_of(state_with({exposed("AP"), missing}));
  EXPECT_EQ(card_of(cards, Phase::acquire).figure, "1 of 2 X-ray images");
  EXPECT_EQ(card_of(cards, Phase::acquire).why, "LAT is next");
  EXPECT_EQ(card_of(cards, Phase::acquire).status, StepStatus::waiting);
}

TEST(Steps, RefusalNamesItsReasonAndIsCleared) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.refusals[Phase::rectify] = {Reason::plate_not_found, "no plate", "LAT"};
  const StepCard card = card_of(steps_of(state), Phase::rectify);
  EXPECT_EQ(card.status, StepStatus::refused);
  EXPECT_EQ(card.why, "LAT: no plate (plate_not_found)");
}

TEST(Steps, WorkInProgressIsShown) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.busy = Phase::calibrate;
  state.doing = "measuring";
  EXPECT_EQ(card_of(steps_of(state), Phase::calibrate).status, StepStatus::running);
  EXPECT_EQ(card_of(steps_of(state), Phase::calibrate).why, "measuring");
}

TEST(Steps, PlanIsGoodOnlyWithAllEndsLocatedAndShowsTheLargestError) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.measured = true;
  EXPECT_EQ(card_of(steps_of(state), Phase::plan).why, "click FS in AP");
  for (const char* end : {"FS", "FE"})
    for (const char* view : {"AP", "LAT"}) state.picks.push_back(pick(end, view));
  EXPECT_EQ(card_of(steps_of(state), Phase::plan).status, StepStatus::waiting);  // not measured with them yet
  auto result = std::make_shared<pipeline::Result>(*state.result);
  for (const double sigma_mm : {0.1, 0.2}) {
    pipeline::PointResult point{"FS", localization::PointSource::pick, {}, {}, guidance::PointInFrames{}, 0,
                                {}};
    point.place->covariance_in_calibrator.diagonal().setConstant(sigma_mm * sigma_mm);
    result->points.push_back(point);
  }
  state.result = result;
  state.measured_picks = state.picks;
  const StepCard card = card_of(steps_of(state), Phase::plan);
  EXPECT_EQ(card.status, StepStatus::good);
  EXPECT_EQ(card.figure, "within 0.56 mm (95 %)");  // 0.2 sqrt(7.815)
}

TEST(Steps, VerifyWarnsOfAToolLineWhoseTunnelIsNotLocated) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.measured = true;
  state.tool_lines = {"femur", "tibia"};
  auto result = std::make_shared<pipeline::Result>(*state.result);
  guidance::LineError near{};
  result->verifications.push_back({"tibia", near, near});
  state.result = result;
  const StepCard lacking = card_of(steps_of(state), Phase::verify);
  EXPECT_EQ(lacking.status, StepStatus::warning);
  EXPECT_THAT(lacking.why.toStdString(), HasSubstr("femur"));
  result = std::make_shared<pipeline::Result>(*result);
  result->verifications.push_back({"femur", near, near});
  state.result = result;
  EXPECT_EQ(card_of(steps_of(state), Phase::verify).status, StepStatus::good);
}

TEST(Steps, PointThatCannotBeLocatedRefusesThePlan) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.measured = true;
  for (const char* end : {"FS", "FE"})
    for (const char* view : {"AP", "LAT"}) state.picks.push_back(pick(end, view));
  auto result = std::make_shared<pipeline::Result>(*state.result);
  result->points.push_back({"FE",
                            localization::PointSource::pick,
                            {},
                            {},
                            {},
                            0,
                            Failure{Reason::parallel_rays, "rays are parallel"}});
  state.result = result;
  state.measured_picks = state.picks;
  EXPECT_EQ(card_of(steps_of(state), Phase::plan).status, StepStatus::refused);
  EXPECT_THAT(card_of(steps_of(state), Phase::plan).why.toStdString(), HasSubstr("parallel_rays"));
}

TEST(Steps, WarningsStandUnderTheStepThatTheyConcern) {
  pipeline::ViewResult view;
  view.name = "AP";
  view.xray_image = std::make_shared<xray::XrayImage>();
  view.rectification.emplace();
  view.found.emplace();
  view.calibrated.emplace();
  ApplicationState state = state_with({view});
  auto result = std::make_shared<pipeline::Result>(*state.result);
  using pipeline::Stage;
  result->warnings = {
      {{Reason::spacing_missing, "no pixel size"}, Stage::read},
      {{Reason::residual_too_large, "few dots"}, Stage::rectify},
      {{Reason::few_fiducials, "five balls"}, Stage::calibrate},
      {{Reason::residual_too_large, "the rays miss", {}, {{"ray_gap_mm", 3}}}, Stage::locate}};
  state.result = result;
  const auto cards = steps_of(state);
  const auto why = [&](Phase phase) { return card_of(cards, phase).why.toStdString(); };
  EXPECT_THAT(why(Phase::calibrate), HasSubstr("five balls"));
  EXPECT_THAT(why(Phase::calibrate), testing::Not(HasSubstr("more")));
  EXPECT_THAT(why(Phase::rectify), HasSubstr("few dots"));
  state.views = {"AP"};
  EXPECT_THAT(card_of(steps_of(state), Phase::acquire).why.toStdString(), HasSubstr("no pixel size"));
}

TEST(Steps, VerifyShowsTheImagesFiguresWithoutARobot) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  state.measured = true;
  state.source = Source::files;
  EXPECT_EQ(card_of(steps_of(state), Phase::navigate).why, "images from files: no robot");
  auto result = std::make_shared<pipeline::Result>(*state.result);
  guidance::LineError near, far;
  near.distance_mm = 0.4;
  far.distance_mm = 0.9;
  result->verifications = {{"femur", near, far}};
  state.result = result;
  EXPECT_EQ(card_of(steps_of(state), Phase::verify).figure, "0.90 mm, 2 ends");
  EXPECT_EQ(card_of(steps_of(state), Phase::verify).status, StepStatus::good);
  result->verifications[0].end->distance_mm = 12;
  EXPECT_EQ(card_of(steps_of(state), Phase::verify).status, StepStatus::warning);
}

TEST(Picks, NextOneGoesThroughViewsThenEnds) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT")});
  EXPECT_EQ(next_pick(state)->point + next_pick(state)->view, "FSAP");
  state.picks.push_back(pick("FS", "AP"));
  EXPECT_EQ(next_pick(state)->point + next_pick(state)->view, "FSLAT");
}

TEST(Picks, TwoOfThreeViewsAreEnough) {
  ApplicationState state = state_with({exposed("AP"), exposed("LAT"), exposed("OBL")});
  state.views.push_back("OBL");
  state.picks = {pick("FS", "AP"), pick("FS", "OBL")};
  EXPECT_EQ(next_pick(state)->point + next_pick(state)->view, "FEAP");
}

TEST(Steps, ImagesWithoutACaseDemandNone) {
  ApplicationState state = state_with({exposed("AP")});
  state.source = Source::images;
  state.views = {"AP"};
  const auto cards = steps_of(state);
  EXPECT_EQ(card_of(cards, Phase::acquire).status, StepStatus::good);
  EXPECT_EQ(card_of(cards, Phase::acquire).figure, "1 X-ray image");
  EXPECT_EQ(card_of(cards, Phase::calibrate).why, "needs a case");
}

TEST(StatusIndicators, OldPoseIsNotGreen) {
  operation::TrackerPlan plan;
  const auto indicators = tracker_indicators(plan, {{.name = "femur", .rejected = {}, .age_s = 0.02},
                                                    {.name = "tibia", .rejected = {}, .age_s = 0.4},
                                                    {.name = "tool", .rejected = {}, .age_s = 7.0}});
  EXPECT_EQ(indicators[0].light, Light::off);
  EXPECT_EQ(indicators[1].light, Light::green);
  EXPECT_EQ(indicators[1].text, "20 ms");
  EXPECT_EQ(indicators[2].light, Light::amber);
  EXPECT_EQ(indicators[3].light, Light::red);
  EXPECT_EQ(indicators[3].text, "7.0 s");
}

TEST(StatusIndicators, CalibratorIsVisibleByOneFacet) {
  operation::TrackerPlan plan;
  plan.facets = {{"calibrator/1", {}}, {"calibrator/2", {}}};
  const auto indicators = tracker_indicators(plan, {{.name = "calibrator/1", .rejected = {}, .age_s = 30.0},
                                                    {.name = "calibrator/2", .rejected = {}, .age_s = 0.03}});
  EXPECT_EQ(indicators[0].light, Light::green);
}

TEST(StatusIndicators, StoppedRobotIsRedWithTheReason) {
  robot::RobotLinkStatus status;
  status.phase = robot::LinkPhase::stopped;
  status.why = Failure{Reason::robot_stopped, "emergency stop"};
  const StatusIndicator indicator = robot_indicator(status);
  EXPECT_EQ(indicator.light, Light::red);
  EXPECT_THAT(indicator.why.toStdString(), HasSubstr("emergency stop"));
}

TEST(StatusIndicators, CArmIsGreenByItsLastImageAndRedAfterAFailure) {
  EXPECT_EQ(c_arm_indicator({}, 100).light, Light::off);
  const StatusIndicator well = c_arm_indicator({.last_image_s = 93, .refused = {}}, 100);
  EXPECT_EQ(well.light, Light::green);
  EXPECT_EQ(well.text, "7.0 s ago");
  EXPECT_EQ(c_arm_indicator({.last_image_s = 93, .refused = {}, .broke_off = true}, 100).light, Light::red);
  const StatusIndicator refused =
      c_arm_indicator({.last_image_s = 93, .refused = Failure{Reason::bad_value, "cut"}}, 100);
  EXPECT_EQ(refused.light, Light::red);
  EXPECT_THAT(refused.why.toStdString(), HasSubstr("cut"));
}

TEST(Worker, RunsItsJobsInOrderAndStopsAfterTheRunningOne) {
  std::vector<int> done;
  {
    Worker worker;
    std::mutex all;
    std::condition_variable last;
    bool over = false;
    for (int i = 0; i < 100; ++i) worker.post([&, i] { done.push_back(i); });
    worker.post([&] {
      const std::lock_guard lock(all);
      over = true;
      last.notify_one();
    });
    std::unique_lock lock(all);
    last.wait(lock, [&] { return over; });
  }
  ASSERT_EQ(done.size(), 100U);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(done[std::size_t(i)], i);
}

}  // namespace
}  // namespace helicarm::gui
