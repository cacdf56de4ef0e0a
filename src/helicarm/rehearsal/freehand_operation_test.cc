// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/replay.h"
#include "helicarm/operation/session_log.h"
#include "helicarm/rehearsal/full_disk_test.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/rehearsal/rewritten_record_test.h"
#include "helicarm/xray/digest.h"

namespace helicarm::rehearsal {
namespace {

using virtual_devices::VirtualDevices;

TEST(FreehandOperation, PersonWhoFollowsTheGuidanceDrillsBothTunnels) {
  const TemporaryFolder folder;
  RehearsalOptions options;
  options.image_size = 512;
  const auto done = rehearse_freehand(3, folder.path() / "session", options);
  ASSERT_TRUE(done) << done.error().message;
  ASSERT_EQ(done->ends.size(), 4u);
  for (const EndError& end : done->ends) {
    EXPECT_LT(end.true_mm, 2.5) << end.name;
    EXPECT_LT(std::abs(end.true_mm - end.measured_mm), 3 * end.predicted_mm) << end.name;
  }
  const auto replayed = operation::replay(folder.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->finished);
  EXPECT_GE(replayed->decisions, 2u);
  EXPECT_TRUE(replayed->differences.empty()) << replayed->differences.front();
}

/// Virtual devices with a hand-held drill, after the measurement, guided to the femur's tunnel.
class GuidedDrill : public testing::Test {
 protected:
  static constexpr std::chrono::milliseconds window{1800};
  /// On a loaded machine poses of this age still guide the test.
  static constexpr double oldest_s = 0.4;

  GuidedDrill() {
    virtual_devices::VirtualDevicesOptions options;
    options.image_size = 512;
    options.tracker_rate_hz = 100;
    options.tracker_port = 0;
    options.freehand = true;
    virtual_or_ = VirtualDevices::open(options).value();
    operation::OperationPlan plan = plan_for(*virtual_or_, virtual_or_->tracker().port());
    plan.check_points = {{"femur notch", "femur", 1.5}};
    devices_ = std::make_unique<operation::Connections>(
        plan, receiver::Inbox::open(folder_.path() / "inbox").value());
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    EXPECT_TRUE(devices_->listen(receiving));
    operation_ =
        operation::Operation::begin_freehand(plan, folder_.path() / "session", devices_->board()).value();
    virtual_or_->touch("femur");
    repeat([&] { return operation_->touch("femur notch").has_value(); });
    for (const char* view : {"AP", "LAT"}) repeat([&] { return take(view); });
    EXPECT_TRUE(operation_->measure());
    repeat([&] { return operation_->touch("femur notch").has_value(); });
    repeat([&] { return operation_->guide("femur", oldest_s).has_value(); });
  }
  bool take(const std::string& view) {
    EXPECT_TRUE(virtual_devices::shoot(virtual_or_->simulated_scene(), view,
                                       {"127.0.0.1", devices_->receiver_port()}));
    const operation::DatedArrival image = devices_->next_image(20).value();
    return operation_->take(view, image.arrival, image.time_s).has_value();
  }
  /// Until it holds; a busy machine may delay the tracker.
  template <class Holds>
  static void repeat(const Holds& holds) {
    for (int i = 0; i < 8; ++i) {
      std::this_thread::sleep_for(window);
      if (holds()) return;
    }
    ADD_FAILURE() << "does not hold";
  }
  bool waits_for(std::string_view decision) {
    for (int i = 0; i < 200; ++i) {
      if (operation_->guidance().value().decision() == decision) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }

  std::uintmax_t log_bytes() const {
    return std::filesystem::file_size(folder_.path() / "session" / "session.log");
  }
  std::vector<operation::SessionRecord> records() const {
    return operation::read_session(folder_.path() / "session" / "session.log").value().records;
  }

  /// A copy of the session as a version wrote it that stated neither depths nor ends of guidance.
  std::filesystem::path as_recorded_earlier() {
    const std::filesystem::path session = folder_.path() / "session", copy = folder_.path() / "earlier";
    std::filesystem::copy(session, copy, std::filesystem::copy_options::recursive);
    std::filesystem::remove(copy / "session.log");
    const auto log = operation::SessionLog::open(copy / "session.log").value();
    operation::SessionHistory history = operation::read_session(session / "session.log").value();
    for (operation::SessionRecord& record : history.records) {
      if (record.kind == "session" || record.kind == "guidance_ended") continue;
      if (record.kind == "outcome") record.content.erase("depth");
      if (record.kind == "guided") as_decided_earlier(record.content.at("guidance"));
      if (record.kind == "result") measure_as_earlier(copy, record.content);
      EXPECT_TRUE(log->append(record.kind, record.content));
    }
    return copy;
  }
  static void as_decided_earlier(Json& guidance) {
    if (guidance.contains("aim")) guidance["aim"].erase("errors");
    if (guidance.at("decision") != "uncertain") return;
    const std::string message = guidance.at("message");
    guidance["message"] = message.substr(0, message.find("; by "));
  }
  static void measure_as_earlier(const std::filesystem::path& session, Json& content) {
    const std::filesystem::path file = session / content.at("folder").get<std::string>() / "result.json";
    Json result = read_json(file).value();
    for (Json& tunnel : result.at("verification"))
      for (const char* key : {"beyond_end_mm", "depth_error_95_mm", "depth_tolerance_mm"}) tunnel.erase(key);
    Json& warnings = result.at("warnings");
    for (auto warning = warnings.begin(); warning != warnings.end();)
      warning = warning->at("figures").contains("beyond_end_mm") ? warnings.erase(warning) : warning + 1;
    EXPECT_TRUE(write_file(file, to_text(result)));
    content["digest"] = operation::digest_of(result);
    content["files"]["result.json"] = xray::digest(read_file(file, 1 << 26).value());
  }

  TemporaryFolder folder_;
  std::unique_ptr<VirtualDevices> virtual_or_;
  std::unique_ptr<operation::Connections> devices_;
  std::unique_ptr<operation::Operation> operation_;
};

TEST_F(GuidedDrill, DecisionsFollowTheScene) {
  EXPECT_TRUE(waits_for("off_target"));
  virtual_or_->drill().move("femur", virtual_or_->drill().on_tunnel("femur", 5), 1);
  EXPECT_TRUE(waits_for("on_target"));
  ASSERT_TRUE(virtual_or_->set_fault("hide:tool", true));
  EXPECT_TRUE(waits_for("no_pose"));
  ASSERT_TRUE(virtual_or_->set_fault("hide:tool", false));
  EXPECT_TRUE(waits_for("on_target"));

  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {3, 0, 0}});
  EXPECT_TRUE(waits_for("plan_stale"));
  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {-3, 0, 0}});
  std::this_thread::sleep_for(window);
  EXPECT_EQ(operation_->guidance()->decision(), "plan_stale");  // until guidance begins again
  EXPECT_EQ(operation_->guide("femur").error().message, "femur notch: touch this check point first");
  repeat([&] { return operation_->touch("femur notch").has_value(); });
  repeat([&] { return operation_->guide("femur", oldest_s).has_value(); });
  EXPECT_TRUE(waits_for("on_target"));
  EXPECT_EQ(operation_->preview_tour().error().reason, Reason::usage);

  operation_.reset();
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->differences.empty()) << replayed->differences.front();
  ASSERT_EQ(replayed->guidances.size(), 2u);
  EXPECT_EQ(replayed->guidances.front().ended_by, "plan_stale");
  EXPECT_FALSE(replayed->guidances.back().ended_s);  // the program ended without
}

TEST_F(GuidedDrill, TunnelDrilledTooDeepIsVerifiedWithItsDepth) {
  EXPECT_TRUE(waits_for("off_target"));
  const double length_mm = operation_->guidance()->aim.value().length_mm;
  virtual_or_->drill().move("femur", virtual_or_->drill().on_tunnel("femur", length_mm + 1.8), 1);
  Expected<operation::TunnelOutcome> outcome = fail(Reason::usage, "not tried");
  repeat([&] { return (outcome = operation_->verify_drilled("femur")).has_value(); });
  ASSERT_TRUE(outcome) << outcome.error().message;
  const guidance::TipDepth depth = outcome->depth().value();
  const double true_mm =
      -(virtual_or_->tracker_from_tip().inverse() * virtual_or_->simulated_scene().point_in_tracker("FS"))
           .z();
  EXPECT_NEAR(true_mm, 1.8, 1);
  EXPECT_NEAR(depth.beyond_end_mm, true_mm, 4 * depth.sigma_mm + 0.3);  // the hand trembles
  EXPECT_LT(depth.error_95_mm(), 1);
  const pipeline::Result exported = operation_->measurement().value().result;
  for (const pipeline::Result& stated : {*operation_->newest_result(), exported})
    EXPECT_EQ(
        depth.why_off("femur").has_value(),
        std::ranges::find(stated.warnings, Reason::off_target, &Warning::reason) != stated.warnings.end());
  EXPECT_TRUE(exported.verifications.front().depth);

  EXPECT_TRUE(operation_->finish());
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->complete()) << fmt::format("{}", fmt::join(replayed->differences, "\n"));
  EXPECT_EQ(replayed->guidances.front().ended_by, "verified");

  const auto earlier = operation::replay(as_recorded_earlier());
  ASSERT_TRUE(earlier) << earlier.error().message;
  EXPECT_TRUE(earlier->complete()) << fmt::format("{}", fmt::join(earlier->differences, "\n"));
  EXPECT_FALSE(earlier->guidances.front().ended_s);

  auto of_another = records(), of_replaced_images = of_another;
  for (operation::SessionRecord& record : of_another)
    if (record.kind == "outcome") record.content["tunnel"] = "tibia";
  operation_.reset();
  rewrite_record(folder_.path() / "session", of_another);
  EXPECT_THAT(operation::replay(folder_.path() / "session")->differences,
              testing::Contains(testing::HasSubstr("femur: ended as verified without an outcome")));

  const auto kind = &operation::SessionRecord::kind;
  of_replaced_images.insert(std::ranges::find(of_replaced_images, "guided", kind),
                            *std::ranges::find(of_replaced_images, "exposure", kind));
  rewrite_record(folder_.path() / "session", of_replaced_images);
  EXPECT_THAT(operation::replay(folder_.path() / "session")->differences,
              testing::Contains(testing::HasSubstr("a decision on images that had been replaced")));
}

TEST_F(GuidedDrill, DrillIsVerifiedInTheGuidedTunnelOrWhereItIs) {
  EXPECT_EQ(operation_->verify_drilled("tibia").error().reason, Reason::usage);
  EXPECT_TRUE(operation_->guidance());  // goes on
  EXPECT_TRUE(operation_->end_guidance());
  repeat([&] {
    const auto outcome = operation_->verify_drilled("femur");
    return !outcome && outcome.error().reason == Reason::off_target;
  });
}

TEST_F(GuidedDrill, WhatIsForgottenIsNotInForceWhereItCannotBeRecorded) {
  ASSERT_TRUE(operation_->measurement());
  {
    const FullDisk full(log_bytes() + 10);
    EXPECT_EQ(operation_->measure().error().reason, Reason::cannot_write);
  }
  EXPECT_EQ(operation_->measurement().error().reason, Reason::usage);
  EXPECT_EQ(operation_->guidance().error().reason, Reason::usage);
  EXPECT_TRUE(operation_->measure());
}

TEST_F(GuidedDrill, EndIsRecordedWhereThatOfTheGuidanceCannotBe) {
  const std::uintmax_t before = log_bytes();
  EXPECT_TRUE(operation_->end_guidance());
  const std::uintmax_t line = log_bytes() - before - 10;  // longer than that of the operation's end
  repeat([&] { return operation_->guide("femur", oldest_s).has_value(); });
  {
    const FullDisk full(log_bytes() + line);
    EXPECT_EQ(operation_->finish().error().reason, Reason::cannot_write);
  }
  const auto replayed = operation::replay(folder_.path() / "session").value();
  EXPECT_TRUE(replayed.complete()) << fmt::format("{}", fmt::join(replayed.differences, "\n"));
  EXPECT_FALSE(replayed.guidances.back().ended_s);
}

TEST_F(GuidedDrill, RecordSaysByWhatGuidanceEnded) {
  const auto guide = [&] { repeat([&] { return operation_->guide("femur", oldest_s).has_value(); }); };
  guide();
  EXPECT_TRUE(operation_->end_guidance());
  guide();
  repeat([&] { return take("AP"); });
  EXPECT_TRUE(operation_->measure());
  EXPECT_EQ(operation_->guide("femur", oldest_s).error().reason, Reason::usage);
  repeat([&] { return operation_->touch("femur notch").has_value(); });  // since the last image
  guide();
  EXPECT_TRUE(operation_->finish());
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->complete()) << fmt::format("{}", fmt::join(replayed->differences, "\n"));
  std::vector<std::string> ended_by;
  for (const operation::GuidanceSpan& span : replayed->guidances) ended_by.push_back(span.ended_by);
  EXPECT_EQ(ended_by, (std::vector<std::string>{"new_guidance", "person", "new_plan", "operation"}));

  auto set_back = records();  // the clock, while the drill was guided
  const auto end = std::ranges::find(set_back, "guidance_ended", &operation::SessionRecord::kind);
  for (operation::SessionRecord& record : std::ranges::subrange(end, set_back.end())) record.time_s -= 3600;
  operation_.reset();
  rewrite_record(folder_.path() / "session", set_back);
  const auto spans = operation::replay(folder_.path() / "session").value().guidances;
  for (const operation::GuidanceSpan& span : spans) EXPECT_GE(span.ended_s.value(), span.begun_s);
}

TEST_F(GuidedDrill, GuidanceEndsWithItsRecord) {
  EXPECT_TRUE(waits_for("off_target"));
  std::filesystem::remove(folder_.path() / "session" / "session.log");
  const auto now = operation_->guidance();
  ASSERT_FALSE(now);
  EXPECT_EQ(now.error().reason, Reason::record_lost) << now.error().message;
  EXPECT_EQ(operation_->guidance().error().reason, Reason::usage);
  EXPECT_EQ(operation_->guide("femur", oldest_s).error().reason, Reason::record_lost);
  EXPECT_EQ(operation_->verify_drilled("femur").error().reason, Reason::record_lost);
}

}  // namespace
}  // namespace helicarm::rehearsal
