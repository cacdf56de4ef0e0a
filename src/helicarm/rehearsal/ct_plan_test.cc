// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/ct_plan.h"

#include <thread>

#include <gmock/gmock.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/replay.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/rehearsal/rewritten_record_test.h"

namespace helicarm::rehearsal {
namespace {

using testing::HasSubstr;
using virtual_devices::VirtualDevices;

void expect_replayed(const std::filesystem::path& session, std::size_t registrations) {
  const auto replayed = operation::replay(session);
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_EQ(replayed->registrations, registrations);
  EXPECT_TRUE(replayed->differences.empty()) << replayed->differences.front();
}

RehearsalOptions by_ct() {
  RehearsalOptions options;
  options.image_size = 512;
  options.ct_plan = true;
  return options;
}

TEST(CtPlan, TheRobotIsGuidedToThePlanOfTheCt) {
  const TemporaryFolder folder;
  std::filesystem::path session;
  Expected<Rehearsal> done = fail(Reason::interrupted, "not begun");
  for (int attempt = 1; attempt <= 3 && !done; ++attempt) {  // a busy machine may be late
    session = folder.path() / ("session" + std::to_string(attempt));
    done = rehearse(3, session, by_ct());
  }
  ASSERT_TRUE(done) << done.error().message;
  ASSERT_EQ(done->ends.size(), 4u);
  for (const EndError& end : done->ends) {
    EXPECT_LT(end.true_mm, 2.5) << end.name;
    EXPECT_TRUE(end.in_xrays_mm) << end.name;
  }
  expect_replayed(session, 1);
}

TEST(CtPlan, ADrillInTheHandIsGuidedToThePlanOfTheCt) {
  const TemporaryFolder folder;
  const auto done = rehearse_freehand(4, folder.path() / "session", by_ct());
  ASSERT_TRUE(done) << done.error().message;
  ASSERT_EQ(done->ends.size(), 4u);
  for (const EndError& end : done->ends) EXPECT_LT(end.true_mm, 2.5) << end.name;
  expect_replayed(folder.path() / "session", 1);
}

/// Virtual devices with a hand-held drill and a plan of the CT, after the images.
class CtOperation : public testing::Test {
 protected:
  static constexpr std::chrono::milliseconds window{1800};

  void begin(const CtPlanOptions& options = {}) {
    virtual_devices::VirtualDevicesOptions ports;
    ports.image_size = 512;
    ports.tracker_rate_hz = 100;
    ports.tracker_port = 0;
    ports.freehand = true;
    virtual_or_ = VirtualDevices::open(ports).value();
    const operation::OperationPlan plan =
        with_ct_plan(plan_for(*virtual_or_, virtual_or_->tracker().port()),
                     virtual_or_->simulated_scene().simulated_case(), folder_.path(), options);
    devices_ = std::make_unique<operation::Connections>(
        plan, receiver::Inbox::open(folder_.path() / "inbox").value());
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    ASSERT_TRUE(devices_->listen(receiving));
    auto begun = operation::Operation::begin_freehand(plan, folder_.path() / "session", devices_->board());
    ASSERT_TRUE(begun) << begun.error().message;
    operation_ = *std::move(begun);
    for (const char* view : {"AP", "LAT"}) acquire(view);
    ASSERT_TRUE(operation_->measure());
  }
  /// A busy machine may delay the tracker.
  void acquire(const std::string& view) {
    for (int attempt = 0; attempt < 8; ++attempt) {
      std::this_thread::sleep_for(window);
      EXPECT_TRUE(virtual_devices::shoot(virtual_or_->simulated_scene(), view,
                                         {"127.0.0.1", devices_->receiver_port()}));
      const operation::DatedArrival image = devices_->next_image(20).value();
      if (operation_->take(view, image.arrival, image.time_s)) return;
    }
    ADD_FAILURE() << view << " was not taken";
  }
  Expected<void> guided() {
    Expected<void> begun;
    for (int attempt = 0; attempt < 8; ++attempt) {
      begun = operation_->guide("femur", 0.4);
      if (begun || begun.error().reason == Reason::registration_not_confirmed ||
          begun.error().reason == Reason::registration_stale)
        return begun;
      std::this_thread::sleep_for(window);
    }
    return begun;
  }

  TemporaryFolder folder_;
  std::unique_ptr<VirtualDevices> virtual_or_;
  std::unique_ptr<operation::Connections> devices_;
  std::unique_ptr<operation::Operation> operation_;
};

TEST_F(CtOperation, ARegistrationThatNobodyHasLookedAtGuidesNothing) {
  begin();
  EXPECT_EQ(guided().error().reason, Reason::registration_not_confirmed);
  const auto registered = operation_->register_models();
  ASSERT_TRUE(registered) << registered.error().message;
  EXPECT_EQ(guided().error().reason, Reason::registration_not_confirmed);
  EXPECT_EQ(operation_->verify_drilled("femur").error().reason, Reason::registration_not_confirmed);
  ASSERT_TRUE(operation_->confirm_registration());
  const auto begun = guided();
  EXPECT_TRUE(begun) << begun.error().message;
  acquire("AP");
  ASSERT_TRUE(operation_->measure());
  EXPECT_EQ(guided().error().reason, Reason::registration_stale);
  EXPECT_EQ(operation_->guidance().error().reason, Reason::usage);
  EXPECT_EQ(operation_->confirm_registration().error().reason, Reason::usage);
  ASSERT_TRUE(operation_->finish());
  expect_replayed(folder_.path() / "session", 1);
}

TEST_F(CtOperation, AVerificationThatIsRefusedGuidesOnFromTheSamePoses) {
  begin();
  ASSERT_TRUE(operation_->register_models());
  ASSERT_TRUE(operation_->confirm_registration());
  ASSERT_TRUE(guided());
  EXPECT_EQ(operation_->verify_drilled("femur").error().reason, Reason::off_target);  // far before its end
  ASSERT_TRUE(operation_->guidance());
  virtual_or_->simulated_scene().bump_marker("femur", {3, 0, 0});
  const auto decision = [&] { return std::string(operation_->guidance().value().decision()); };
  for (int look = 0; look < 100 && decision() != "plan_stale"; ++look)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(decision(), "plan_stale");
  EXPECT_EQ(operation_->verify_drilled("femur").error().reason, Reason::plan_stale);
  EXPECT_EQ(decision(), "plan_stale");
  ASSERT_TRUE(operation_->measure());  // ends the guidance
  EXPECT_EQ(operation_->guidance().error().reason, Reason::usage);
  ASSERT_TRUE(operation_->finish());
  expect_replayed(folder_.path() / "session", 1);
}

TEST_F(CtOperation, ARefusedRegistrationGuidesNothing) {
  begin({.off_mm = 2, .off_deg = 2, .diameter_mm = 4, .wrong_bone = true});
  const auto registered = operation_->register_models();
  ASSERT_FALSE(registered);
  EXPECT_EQ(exit_code(registered.error().reason), 3) << registered.error().message;
  EXPECT_EQ(operation_->confirm_registration().error().reason, registered.error().reason);
  EXPECT_EQ(guided().error().reason, Reason::registration_not_confirmed);
  ASSERT_TRUE(operation_->finish(registered.error()));
  expect_replayed(folder_.path() / "session", 1);
}

TEST_F(CtOperation, AModelThatAPersonMovedIsRegisteredFromThere) {
  begin();
  ASSERT_TRUE(operation_->register_models());
  const registration::Registration right = operation_->registration()->models.front().registration;
  ASSERT_TRUE(operation_->confirm_registration());
  geometry::RigidTransform moved = right.world_from_model;
  moved.translation.x() += 3;
  const auto again = operation_->register_models({{"femur", moved}});
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(guided().error().reason, Reason::registration_not_confirmed);
  EXPECT_LT((operation_->registration()->models.front().registration.centre - right.centre).norm(), 0.1);
  ASSERT_TRUE(operation_->confirm_registration());
  EXPECT_EQ(operation_->result().model_tunnels.size(), 2U);
  EXPECT_EQ(operation_->register_models({{"hip", moved}}).error().reason, Reason::bad_value);
  ASSERT_TRUE(operation_->finish());
  expect_replayed(folder_.path() / "session", 2);
}

TEST_F(CtOperation, ARegistrationThatIsCancelledGuidesNothing) {
  begin();
  const auto cancel = [] { throw BadInput(Reason::interrupted, "cancelled"); };
  EXPECT_EQ(operation_->register_models({}, cancel).error().reason, Reason::interrupted);
  EXPECT_EQ(operation_->confirm_registration().error().reason, Reason::usage);
  EXPECT_TRUE(operation_->register_models());
}

TEST_F(CtOperation, ATunnelWhoseWallLeavesTheBoneIsRefused) {
  begin({.off_mm = 2, .off_deg = 2, .diameter_mm = 25, .wrong_bone = false});
  const auto registered = operation_->register_models();
  ASSERT_FALSE(registered);
  EXPECT_EQ(registered.error().reason, Reason::tunnel_breach) << registered.error().message;
}

TEST_F(CtOperation, AModelThatWasReplacedAfterwardsIsFoundByTheReplay) {
  begin();
  ASSERT_TRUE(operation_->register_models());
  ASSERT_TRUE(operation_->confirm_registration());
  ASSERT_TRUE(operation_->finish());
  operation_.reset();
  std::filesystem::copy_file(folder_.path() / "tibia.nrrd", folder_.path() / "session/models/1/femur.nrrd",
                             std::filesystem::copy_options::overwrite_existing);
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed);
  EXPECT_THAT(replayed->differences, testing::Contains(HasSubstr("models/1/femur.nrrd was changed")));
}

TEST_F(CtOperation, ARegistrationThatDiffersIsReportedOnce) {
  begin();
  ASSERT_TRUE(operation_->register_models());
  ASSERT_TRUE(operation_->confirm_registration());
  ASSERT_TRUE(operation_->finish());
  operation_.reset();
  auto records = operation::read_session(folder_.path() / "session" / "session.log").value().records;
  for (operation::SessionRecord& record : records)
    if (record.kind == "registered" || record.kind == "registration_confirmed")
      record.content["digest"] = std::string(64, '0');
  rewrite_record(folder_.path() / "session", records);
  EXPECT_THAT(operation::replay(folder_.path() / "session").value().differences,
              testing::ElementsAre(HasSubstr("the registration differs from the recorded one")));
}

}  // namespace
}  // namespace helicarm::rehearsal
