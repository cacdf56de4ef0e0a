// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/timeline.h"

#include <QTemporaryDir>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/replay/session_test.h"

namespace helicarm::gui {
namespace {

class TimelineTest : public testing::Test {
 protected:
  void SetUp() override { write_session(folder_); }
  Timeline read() const { return read_timeline(folder_).value(); }

  QTemporaryDir root_;
  const std::filesystem::path folder_ = root_.path().toStdString();
};

TEST_F(TimelineTest, EveryKindHasASummary) {
  const Timeline timeline = read();
  ASSERT_EQ(timeline.moments.size(), session_kinds.size());
  for (std::size_t i = 0; i < timeline.moments.size(); ++i) {
    EXPECT_EQ(timeline.moments[i].kind, session_kinds[i]);
    EXPECT_NE(timeline.moments[i].summary.toStdString(), session_kinds[i]) << "no summary of its own";
    EXPECT_EQ(parse_json(timeline.moments[i].detail().toStdString(), "detail").value(),
              timeline.moments[i].content);
  }
  EXPECT_TRUE(timeline.finished);
  EXPECT_FALSE(timeline.torn);
  EXPECT_EQ(timeline.moments[3].summary, "Acquisition AP");
  EXPECT_THAT(timeline.moments[11].summary.toStdString(), testing::HasSubstr("error 0.25 mm"));
}

TEST_F(TimelineTest, TimeRunsForwardFromZero) {
  const Timeline timeline = read();
  EXPECT_EQ(timeline.moments.front().seconds, 0);
  for (std::size_t i = 1; i < timeline.moments.size(); ++i)
    EXPECT_GE(timeline.moments[i].seconds, timeline.moments[i - 1].seconds);
  EXPECT_EQ(timeline.at(-1), 0u);
  EXPECT_EQ(timeline.at(timeline.length_s() + 1), timeline.moments.size() - 1);
}

TEST_F(TimelineTest, StateAccumulatesOverTheMoments) {
  const Timeline timeline = read();
  const SessionState begin = state_at(timeline, 1).value();
  EXPECT_TRUE(begin.exposures.empty());
  EXPECT_FALSE(begin.case_folder);
  const SessionState exposed = state_at(timeline, 4).value();
  EXPECT_THAT(exposed.exposures, testing::ElementsAre("AP", "LAT"));
  EXPECT_EQ(exposed.tracker_from.at("femur")->translation.x(), 2);
  EXPECT_FALSE(exposed.tracker_from.at("tibia")) << "looked for, and not seen";
  EXPECT_FALSE(exposed.tracker_from.contains("tool"));
  const SessionState begun = state_at(timeline, 5).value();
  EXPECT_FALSE(begun.case_folder) << "without a result";
  EXPECT_FALSE(begun.measured);
  const SessionState measured = state_at(timeline, 6).value();
  EXPECT_EQ(measured.case_folder, folder_ / "case-1");
  EXPECT_TRUE(measured.measured);
  const SessionState end = state_at(timeline, timeline.moments.size() - 1).value();
  EXPECT_EQ(end.hand_eye_rms_mm, 0.2);
  const operation::TunnelOutcome& femur = end.outcomes.at("femur");
  ASSERT_EQ(femur.loop.size(), 2u);
  EXPECT_EQ(femur.loop[1].distance_mm, 0.25);
  EXPECT_DOUBLE_EQ(femur.start.distance_mm(), 0.5);
  EXPECT_DOUBLE_EQ(femur.end.predicted_mm(), 0.6);
  EXPECT_EQ(end.tracker_from.at("femur")->translation.x(), 3);
}

TEST_F(TimelineTest, ARegistrationOfModelsStandsUntilOtherImagesOrAnotherMeasurement) {
  using namespace operation::record;
  const auto session = operation::SessionLog::open(folder_ / "session.log").value();
  const auto add = [&](const operation::Record& record) {
    ASSERT_TRUE(session->append(std::string(operation::kind_of(record)), operation::content_of(record)));
  };
  add(Registered{"case-1/registration", "aa", {}, {}});
  add(RegistrationConfirmed{"aa", "tester"});
  add(CaseBegun{"case-2", Json::object(), {}, "femur"});
  add(Registered{"case-1/registration", "bb", {}, {}});
  add(CaseBegun{"case-3", Json::object(), {}, {}});
  add(Registered{"case-3/registration", "cc", {}, {}});
  add(Exposure{"AP", "01", {}, {}, window_with(1), guidance::Poses{}});
  const Timeline timeline = read();
  const auto after = [&](std::size_t number) {
    return state_at(timeline, session_kinds.size() - 1 + number).value();
  };
  EXPECT_FALSE(after(0).models);
  EXPECT_EQ(after(1).models->digest, "aa");
  EXPECT_FALSE(after(1).is_confirmed);
  EXPECT_TRUE(after(2).is_confirmed);
  EXPECT_TRUE(after(3).models) << "a verification is of the same images";
  EXPECT_EQ(after(3).case_folder, folder_ / "case-1");
  EXPECT_TRUE(after(3).measured);
  EXPECT_FALSE(after(4).is_confirmed);
  EXPECT_FALSE(after(5).models) << "another measurement";
  EXPECT_EQ(after(6).models->digest, "cc");
  EXPECT_FALSE(after(7).models) << "another image";
}

TEST_F(TimelineTest, AMarkerThatIsNotSeenAnyMoreHasNoPose) {
  using namespace operation::record;
  const auto session = operation::SessionLog::open(folder_ / "session.log").value();
  const auto add = [&](const operation::Record& record) {
    ASSERT_TRUE(session->append(std::string(operation::kind_of(record)), operation::content_of(record)));
  };
  operation::PoseWindow hidden = window_with(4), vanishes = window_with(5), of_others = window_with(6);
  hidden.samples["femur"].clear();
  vanishes.samples["femur"].resize(1);
  of_others.samples.erase("femur");
  add(Poses{Look::verify, window_with(3)});
  add(Poses{Look::verify, hidden});
  add(Poses{Look::verify, window_with(3)});
  add(Poses{Look::verify, vanishes});
  add(Poses{Look::verify, window_with(3)});
  add(Poses{Look::verify, of_others});
  const Timeline timeline = read();
  const auto femur_after = [&](std::size_t number) {
    return state_at(timeline, session_kinds.size() - 1 + number).value().tracker_from.at("femur");
  };
  EXPECT_TRUE(femur_after(1));
  EXPECT_FALSE(femur_after(2));
  EXPECT_TRUE(femur_after(3));
  EXPECT_FALSE(femur_after(4));
  EXPECT_TRUE(femur_after(6)) << "it was not looked for";
}

TEST_F(TimelineTest, TornLogIsReadUpToTheIncompleteRecord) {
  const auto log = folder_ / "session.log";
  std::filesystem::resize_file(log, std::filesystem::file_size(log) - 5);
  const Timeline timeline = read();
  EXPECT_TRUE(timeline.torn);
  EXPECT_FALSE(timeline.finished);
  EXPECT_EQ(timeline.moments.size(), session_kinds.size() - 1);
}

TEST_F(TimelineTest, DamageIsReportedWithItsReason) {
  EXPECT_EQ(read_timeline(folder_ / "nowhere").error().reason, Reason::missing_file);
  std::fstream log(folder_ / "session.log", std::ios::in | std::ios::out | std::ios::binary);
  log.seekp(200);
  log.put('~');
  log.close();
  EXPECT_EQ(read_timeline(folder_).error().reason, Reason::bad_value);
}

TEST_F(TimelineTest, RecordWithoutContentIsNamedInTheMessage) {
  const auto session = operation::SessionLog::open(folder_ / "session.log").value();
  ASSERT_TRUE(session->append("exposure", {{"view", 7}}));
  const auto timeline = read_timeline(folder_);
  ASSERT_FALSE(timeline);
  EXPECT_THAT(timeline.error().message, testing::HasSubstr("record 15"));
}

TEST_F(TimelineTest, CaseOutsideTheSessionIsRefused) {
  const auto session = operation::SessionLog::open(folder_ / "session.log").value();
  const operation::Record measured = operation::record::Measured{"../elsewhere", "05", {}};
  ASSERT_TRUE(session->append("result", operation::content_of(measured)));
  EXPECT_EQ(state_at(read(), session_kinds.size()).error().reason, Reason::path_outside);
}

TEST_F(TimelineTest, AHandHeldDrillReplaysWithItsTouchesAndGuidance) {
  using namespace operation::record;
  const auto session = operation::SessionLog::open(folder_ / "session.log").value();
  const auto add = [&](const operation::Record& record) {
    ASSERT_TRUE(session->append(std::string(operation::kind_of(record)), operation::content_of(record)));
  };
  operation::Guidance off;
  off.aim = operation::TunnelAim{1.25, 3, -4, 30, 0.1, 0.2, 0.1, {1.25, 0, 0}, Eigen::Vector3d::UnitZ()};
  off.why_not = Failure{Reason::off_target, "1.2 mm off the axis"};
  off.age_s = 0.05;
  off.bone_moved = operation::Motion{0.1, 0.2};
  add(Touched{"divot", window_with(4), {1, 2, 3}});
  add(Guide{"tibia", 0.15, window_with(5)});
  add(Guided{"tibia", window_with(6), off});
  const Timeline timeline = read();
  const std::size_t last = timeline.moments.size() - 1;
  EXPECT_EQ(timeline.moments[last - 2].summary, "Check point divot touched");
  EXPECT_EQ(timeline.moments[last - 1].summary, "Drill guided to tibia");
  EXPECT_EQ(timeline.moments[last].summary,
            "Drill at tibia, 1.25 mm and 3.0° off its axis: 1.2 mm off the axis");
  const SessionState state = state_at(timeline, last).value();
  EXPECT_EQ(state.tunnel, "tibia");
  ASSERT_TRUE(state.guidance);
  EXPECT_EQ(state.guidance->why_not->reason, Reason::off_target);
  EXPECT_FALSE(state_at(timeline, last - 1)->guidance) << "of none before";
  EXPECT_TRUE(state_at(timeline, last - 1)->is_guided);
  EXPECT_EQ(state.tracker_from.at("femur")->translation.x(), 6);
  add(GuidanceEnded{"tibia", GuidanceEndedBy::person});
  EXPECT_EQ(read().moments.back().summary, "Guidance to tibia ended: by the person");
  EXPECT_FALSE(state_at(read(), last + 1)->is_guided);
  EXPECT_FALSE(state_at(read(), last + 1)->guidance);
}

/// A measurement of a plan with a tunnel of picks, in the tibia, and one of a model, in the femur.
class MeasuredTimeline : public testing::Test {
 protected:
  void SetUp() override {
    using namespace operation::record;
    operation::OperationPlan plan;
    plan.folder = folder_;
    plan.models.emplace_back().name = "bone";
    plan.models[0].volume = folder_ / "models/ct.nrrd";
    plan.models[0].moves_with = "femur";
    plan.models[0].plan = folder_ / "models/plan.mrk.json";
    plan.tunnels = {{"tibia", "tibia", "TS", "TE"}, {"femur", "femur", "F_start", "F_end"}};
    plan.tunnels[1].of_model = {.name = "femur", .model = "bone", .line = "F"};
    add(Plan{plan});
    for (const char* view : {"AP", "LAT"}) add(Exposure{view, "01", {}, {}, window_with(1), seen()});
    add(CaseBegun{"case-1", Json::object(), {}, {}});
    add(Measured{"case-1", "02", {}});
  }

  static guidance::Poses seen() {
    guidance::Poses poses;
    poses.tracker_from_bone = {{"femur", geometry::RigidTransform()}, {"tibia", geometry::RigidTransform()}};
    return poses;
  }
  void add(const operation::Record& record) {
    const auto session = operation::SessionLog::open(folder_ / "session.log").value();
    ASSERT_TRUE(session->append(std::string(operation::kind_of(record)), operation::content_of(record)));
  }
  void add_outcomes() {
    for (const char* tunnel : {"femur", "tibia"}) {
      add(operation::record::Navigated{tunnel, {{1.5, 1, 0.1}}});
      add(operation::record::Outcome{tunnel, {}, {}});
    }
  }
  SessionState end() const {
    const auto timeline = read_timeline(folder_);
    if (!timeline) throw BadInput(timeline.error());
    return state_at(*timeline, timeline->moments.size() - 1).value();
  }

  QTemporaryDir root_;
  const std::filesystem::path folder_ = root_.path().toStdString();
};

TEST_F(MeasuredTimeline, ARegistrationIsOfTheMeasurementNotOfALaterVerification) {
  using namespace operation::record;
  add(CaseBegun{"case-2", Json::object(), {}, "tibia"});
  EXPECT_TRUE(end().measured);
  EXPECT_EQ(end().case_folder, folder_ / "case-1");
  add(Measured{"case-2", "03", {}});
  EXPECT_EQ(end().case_folder, folder_ / "case-2");
  add(Registered{"case-1/registration", "aa", {}, {}});
  EXPECT_EQ(end().case_folder, folder_ / "case-1");
  EXPECT_TRUE(end().measured);
  add(CaseBegun{"case-3", Json::object(), {}, "femur"});
  add(Measured{"case-3", "04", {}});
  EXPECT_EQ(end().case_folder, folder_ / "case-1");
}

TEST_F(MeasuredTimeline, ARegistrationEndsTheOutcomesInItsTunnels) {
  add_outcomes();
  add(operation::record::Registered{"case-1/registration", "aa", {}, {}});
  EXPECT_FALSE(end().outcomes.contains("femur"));
  EXPECT_FALSE(end().loops.contains("femur"));
  EXPECT_TRUE(end().outcomes.contains("tibia"));
}

TEST_F(MeasuredTimeline, AnotherMeasurementEndsAllOutcomes) {
  add_outcomes();
  EXPECT_EQ(end().outcomes.size(), 2u);
  add(operation::record::CaseBegun{"case-2", Json::object(), {}, {}});
  EXPECT_TRUE(end().outcomes.empty());
  EXPECT_TRUE(end().loops.empty());
  EXPECT_FALSE(end().measured);
}

TEST_F(MeasuredTimeline, AnAcceptedImageEndsTheMeasurement) {
  using namespace operation::record;
  add(Registered{"case-1/registration", "aa", {}, {}});
  add_outcomes();
  add(Exposure{"AP", "05", {}, {}, window_with(1), seen()});
  EXPECT_FALSE(end().measured);
  EXPECT_FALSE(end().models);
  EXPECT_TRUE(end().outcomes.empty());
}

TEST_F(MeasuredTimeline, AnImageWithoutTheMarkerOfATunnelsBoneEndsNothing) {
  using namespace operation::record;
  add(Registered{"case-1/registration", "aa", {}, {}});
  const std::size_t exposed = end().exposed_at.at("AP");
  guidance::Poses without_tibia = seen();
  without_tibia.tracker_from_bone.erase("tibia");
  add(Exposure{"AP", "05", {}, {}, window_with(1), without_tibia});
  EXPECT_TRUE(end().measured);
  EXPECT_TRUE(end().models);
  EXPECT_EQ(end().exposed_at.at("AP"), exposed);
}

TEST_F(MeasuredTimeline, AnImageFoundToBeDelayedEndsTheMeasurement) {
  using namespace operation::record;
  add(Refused{"LAT", "05", "stale_pose", {}});
  EXPECT_TRUE(end().measured);
  add(Refused{"AP", {}, "stale_pose", {}});
  EXPECT_FALSE(end().measured);
}

}  // namespace
}  // namespace helicarm::gui
