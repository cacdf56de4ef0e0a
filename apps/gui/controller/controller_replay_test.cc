// SPDX-License-Identifier: Apache-2.0
// Moments of a recorded operation, and the registration that stood at each.
#include <gtest/gtest.h>

#include "gui/controller/rehearsal_fixtures_test.h"
#include "gui/replay/timeline.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/operation/models.h"

namespace helicarm::gui {
namespace {

namespace fs = std::filesystem;

class ControllerReplay : public ControllerCtRehearsal {
 protected:
  /// An operation up to the confirmed registration, opened as recorded before it.
  void record() {
    ASSERT_TRUE(idle());
    ASSERT_TRUE(acquire());
    ASSERT_TRUE(register_models());
    live_ = state().registration;
    controller_->confirm_registration();
    ASSERT_TRUE(idle());
    timeline_ = read_timeline(state().folder).value();
    controller_->show_recorded(moment_of("result"));
    ASSERT_TRUE(idle());
    ASSERT_TRUE(state().is_replayed);
  }
  /// After the last record of this kind.
  static RecordedMoment moment_in(const Timeline& timeline, const std::string& kind) {
    std::size_t last = 0;
    for (std::size_t i = 0; i < timeline.moments.size(); ++i)
      if (timeline.moments[i].kind == kind) last = i;
    const SessionState then = state_at(timeline, last).value();
    return {*then.case_folder, plan_of(timeline).value(), then.models, then.is_confirmed};
  }
  RecordedMoment moment_of(const std::string& kind) { return moment_in(timeline_, kind); }
  /// The session in another folder.
  Timeline copy() {
    const fs::path session = folder_.path() / "copy";
    fs::copy(timeline_.session, session, fs::copy_options::recursive);
    return read_timeline(session).value();
  }
  bool follows(const RecordedMoment& moment) {
    controller_->show_recorded(moment);
    return idle();
  }

  std::shared_ptr<const case_registration::CaseRegistration> live_;
  Timeline timeline_;
};

TEST_F(ControllerReplay, ShowsTheRegistrationThatStoodAtTheMoment) {
  ASSERT_NO_FATAL_FAILURE(record());
  EXPECT_TRUE(state().has_models);
  EXPECT_FALSE(state().registration);
  EXPECT_FALSE(next_pick(state()));
  EXPECT_EQ(tunnel().of_model->model, "femur");

  ASSERT_TRUE(follows(moment_of("registered")));
  ASSERT_TRUE(state().registration) << observed();
  EXPECT_EQ(operation::recorded(*state().registration), operation::recorded(*live_));
  EXPECT_EQ(state().registration->models[0].outlines, live_->models[0].outlines);
  EXPECT_FALSE(state().is_confirmed);
  const auto replayed = state().registration;
  controller_->show_recorded(moment_of("registration_confirmed"));
  EXPECT_TRUE(state().is_confirmed);
  EXPECT_EQ(state().registration, replayed);  // at once

  registration::RigidStep step = registration::RigidStep::Zero();
  step[3] = 2;
  controller_->nudge(0, step);
  EXPECT_FALSE(state().nudged);
  controller_->show_recorded(moment_of("result"));
  EXPECT_FALSE(state().registration);
}

TEST_F(ControllerReplay, ARegistrationThatIsNotTheRecordedOneIsRefused) {
  ASSERT_NO_FATAL_FAILURE(record());
  RecordedMoment moment = moment_of("registered");
  moment.models->digest = "00";
  ASSERT_TRUE(follows(moment));
  EXPECT_FALSE(state().registration);
  EXPECT_EQ(state().refusals.at(Phase::registration).reason, Reason::replay_differs);
  controller_->show_recorded(moment_of("result"));
  EXPECT_FALSE(state().refusals.contains(Phase::registration));
}

TEST_F(ControllerReplay, AnUnexpectedErrorIsNotTriedAgainBeforeAnotherMomentIsChosen) {
  ASSERT_NO_FATAL_FAILURE(record());
  RecordedMoment moment = moment_of("registered");
  moment.plan.models[0].volume = folder_.path() / "loop";
  fs::create_directory(*moment.plan.models[0].volume);
  fs::create_symlink("itself", *moment.plan.models[0].volume / "itself");
  int refused = 0;
  QObject::connect(controller_.get(), &Controller::refused, [&] { ++refused; });
  controller_->show_recorded(moment);
  ASSERT_TRUE(wait("it is refused", [&] { return refused > 0; }));
  EXPECT_FALSE(state().busy) << observed();
  EXPECT_EQ(state().refusals.at(Phase::registration).reason, Reason::unsupported) << observed();
  ASSERT_TRUE(follows(moment_of("registration_confirmed")));
  EXPECT_TRUE(state().registration) << observed();
}

TEST_F(ControllerReplay, AMomentOfTheOpenCaseWithdrawsTheOneBeforeOfAnotherCase) {
  ASSERT_NO_FATAL_FAILURE(record());
  const RecordedMoment here = moment_of("registered");
  controller_->show_recorded(here);
  ASSERT_EQ(state().busy, Phase::registration);
  controller_->show_recorded(moment_in(copy(), "registered"));
  ASSERT_TRUE(follows(here));
  EXPECT_EQ(state().folder, here.case_folder);
  EXPECT_TRUE(state().registration) << observed();
}

TEST_F(ControllerReplay, ACancelledRegistrationIsMadeAtTheNextMoment) {
  ASSERT_NO_FATAL_FAILURE(record());
  controller_->show_recorded(moment_of("registered"));
  controller_->cancel();
  ASSERT_TRUE(idle());
  EXPECT_FALSE(state().registration);
  EXPECT_EQ(state().refusals.at(Phase::registration).reason, Reason::interrupted);
  ASSERT_TRUE(follows(moment_of("registration_confirmed")));
  EXPECT_TRUE(state().registration) << observed();
  EXPECT_TRUE(state().is_confirmed);
}

TEST_F(ControllerReplay, EachOpeningRegistersByTheFilesThatItFinds) {
  ASSERT_NO_FATAL_FAILURE(record());
  ASSERT_TRUE(follows(moment_of("registered")));
  ASSERT_TRUE(state().registration) << observed();
  const Timeline other = copy();
  const fs::path models = other.session / "models", away = other.session / "away";
  fs::rename(models, away);
  ASSERT_TRUE(follows(moment_in(other, "registered")));
  EXPECT_FALSE(state().registration);
  EXPECT_TRUE(state().refusals.contains(Phase::registration));
  fs::rename(away, models);
  ASSERT_TRUE(follows(moment_of("result")));
  ASSERT_TRUE(follows(moment_in(other, "registered")));
  EXPECT_TRUE(state().registration) << observed();
}

TEST_F(ControllerReplay, AMomentBeforeTheMeasurementIsShownWithoutRegistrationAlsoWhileOpening) {
  ASSERT_NO_FATAL_FAILURE(record());
  controller_->show_recorded(moment_in(copy(), "registration_confirmed"));
  controller_->show_unregistered();
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().is_replayed);
  EXPECT_FALSE(state().registration);
  EXPECT_FALSE(state().is_confirmed);
}

TEST_F(ControllerReplay, AMomentOfACaseThatIsBeingOpenedForItselfIsReplayed) {
  ASSERT_NO_FATAL_FAILURE(record());
  const RecordedMoment moment = moment_of("result");
  controller_->open_case(moment.case_folder, false);
  ASSERT_TRUE(follows(moment));
  EXPECT_TRUE(state().is_replayed);
}

}  // namespace
}  // namespace helicarm::gui
