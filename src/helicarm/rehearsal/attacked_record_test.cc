// SPDX-License-Identifier: Apache-2.0
// Records of a finished operation that were changed afterwards, by someone who recomputes their chain.
#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/replay.h"
#include "helicarm/operation/session_log.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/rehearsal/rewritten_record_test.h"

namespace helicarm::rehearsal {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int most_rehearsals = 10;

/// One rehearsed operation for all tests; each changes a copy.
class AttackedRecord : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    RehearsalOptions options;
    options.image_size = 512;
    Expected<Rehearsal> done = fail(Reason::usage, "not tried");
    options.plans_again = false;
    for (int i = 0; i < most_rehearsals && !done; ++i) {  // a busy machine may end it early
      whole_ = folder_->path() / fmt::format("whole-{}", i);
      done = rehearse(2, whole_, options);
    }
    ASSERT_TRUE(done) << done.error().message;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  void SetUp() override {
    session_ = folder_->path() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::copy(whole_, session_, fs::copy_options::recursive);
    records_ = operation::read_session(session_ / "session.log")->records;
  }

  void write() const { rewrite_record(session_, records_); }
  Json& content(const std::string& kind, std::size_t which = 0) {
    for (operation::SessionRecord& record : records_)
      if (record.kind == kind && which-- == 0) return record.content;
    throw std::out_of_range(kind);
  }
  operation::ReplayReport replayed() const { return operation::replay(session_).value(); }
  /// After a change of the records.
  void expect_difference(const std::string& part) const {
    write();
    expect_differing_files(part);
  }
  void expect_differing_files(const std::string& part) const {
    const operation::ReplayReport report = replayed();
    EXPECT_FALSE(report.complete());
    EXPECT_THAT(report.differences, testing::Contains(HasSubstr(part)));
  }
  void remove_records(const std::string& kind) {
    std::erase_if(records_, [&](const operation::SessionRecord& record) { return record.kind == kind; });
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static fs::path whole_;
  fs::path session_;
  std::vector<operation::SessionRecord> records_;
};
std::unique_ptr<TemporaryFolder> AttackedRecord::folder_;
fs::path AttackedRecord::whole_;

TEST_F(AttackedRecord, UnchangedRecordIsComplete) {
  write();  // the chain is that of the operation itself
  EXPECT_EQ(*read_file(session_ / "session.log", 1 << 26), *read_file(whole_ / "session.log", 1 << 26));
  const operation::ReplayReport report = replayed();
  EXPECT_THAT(report.differences, testing::IsEmpty());
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.orders, 9 + 4u);  // the tour; to each tunnel and back
  EXPECT_EQ(report.confirmations, report.orders);
  EXPECT_EQ(report.outcomes, 2u);
  EXPECT_EQ(report.results, 3u);
}

TEST_F(AttackedRecord, ConfirmationAfterAStopNeedsANewOrder) {
  const auto again = [](const std::string& order, int number) {
    return Json{{"order", order}, {"number", number}, {"why", "stale_state"}, {"by", "tester"}};
  };
  const auto confirmed = std::ranges::find(records_, "confirmed", &operation::SessionRecord::kind);
  ASSERT_NE(confirmed, records_.end());
  operation::SessionRecord replanned = *confirmed;
  replanned.kind = "replanned";
  replanned.content = again("hand-eye", 1);
  const auto inserted = records_.insert(confirmed, replanned);
  expect_difference("the confirmation is not of the last order hand-eye");
  inserted->content = again("hand-eye", operation::most_replans + 1);
  expect_difference("hand-eye was planned again");
}

TEST_F(AttackedRecord, EditedResultDiffers) {
  Json result = *read_json(session_ / "case-1" / "result.json");
  double& x = result["points"][0]["in_bones"]["femur"]["xyz_mm"][0].get_ref<double&>();
  x += 5;
  ASSERT_TRUE(write_file(session_ / "case-1" / "result.json", to_text(result)));
  expect_differing_files("case-1/result.json was changed");
  expect_differing_files(
      "case-1/result.json differs from the recomputed result: /points/0/in_bones/femur/xyz_mm/0");
}

TEST_F(AttackedRecord, EveryRemovedFileDiffers) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(session_))
    if (entry.is_regular_file() && entry.path().filename() != "session.log" &&
        entry.path().parent_path().filename() != "inbox")
      files.push_back(entry.path());
  EXPECT_GE(files.size(), 3 * 7u);
  for (const fs::path& file : files) {
    const fs::path aside = folder_->path() / "aside";
    fs::rename(file, aside);
    EXPECT_FALSE(replayed().complete()) << file;
    fs::rename(aside, file);
  }
}

TEST_F(AttackedRecord, RemovedInboxDiffers) {
  fs::remove_all(session_ / "inbox");
  expect_differing_files("inbox: the image of AP is missing or was changed");
}

TEST_F(AttackedRecord, ChangedOutcomeDiffers) {
  content("outcome")["start"]["distance_mm"] = 0.1;
  expect_difference("start: \"distance_mm\": is not");
}

TEST_F(AttackedRecord, RemovedOutcomeIsMissing) {
  remove_records("outcome");
  expect_difference("the outcome at tibia is missing");
}

TEST_F(AttackedRecord, ChangedOrderDiffers) {
  content("order", 9)["waypoints"][0]["speed_mm_s"] = 33.0;
  expect_difference("the order differs from the recorded value on recomputation: /waypoints/0/speed_mm_s");
}

TEST_F(AttackedRecord, OrderOfTheTourWithAnotherPoseDiffers) {
  double& x = content("order", 3)["waypoints"][0]["base_from_tcp"][0][3].get_ref<double&>();
  x += 1;
  expect_difference("the order differs");
}

TEST_F(AttackedRecord, WithdrawalToAnotherPlaceDiffers) {
  double& x = content("order", 10)["waypoints"][1]["base_from_tcp"][2][3].get_ref<double&>();
  x += 1;
  expect_difference("the order differs");
}

TEST_F(AttackedRecord, ConfirmationOfAnotherOrderDiffers) {
  content("confirmed", 9)["digest"] = content("confirmed", 8)["digest"];
  expect_difference("the confirmation is not of the last order femur");
}

TEST_F(AttackedRecord, ConfirmationByAnotherPersonDiffers) {
  content("confirmed", 9)["by"] = "somebody else";
  expect_difference("the motion is not that which was confirmed");
}

TEST_F(AttackedRecord, MotionWithoutAConfirmationDiffers) {
  remove_records("confirmed");
  expect_difference("the motion is not that which was confirmed");
}

TEST_F(AttackedRecord, ConfirmationWithoutAMotionDiffers) {
  remove_records("carried_out");
  expect_difference("a confirmation before the end of the previous motion");
}

TEST_F(AttackedRecord, ChangedClosedLoopDiffers) {
  content("navigated")["loop"][0]["distance_mm"] = 0.01;
  expect_difference("the closed loop differs");
}

TEST_F(AttackedRecord, CaseOfOtherPosesDiffers) {
  const fs::path file = session_ / "case-1" / "case.json";
  double& x =
      content("case")["case"]["views"][0]["poses"]["tracker_from_bone"]["femur"][0][3].get_ref<double&>();
  x += 1;
  ASSERT_TRUE(write_file(file, to_text(content("case")["case"])));
  expect_difference("the case differs from the recorded value on recomputation");
}

TEST_F(AttackedRecord, ImageReplacedWithItsDigestIsNotTheAcquiredOne) {
  fs::copy_file(session_ / "case-1" / "LAT.dcm", session_ / "case-1" / "AP.dcm",
                fs::copy_options::overwrite_existing);
  content("case")["files"]["AP.dcm"] = content("case")["files"]["LAT.dcm"];
  expect_difference("case-1/AP.dcm is not the recorded image");
}

TEST_F(AttackedRecord, RecordWithoutItsEndIsNotComplete) {
  records_.pop_back();
  write();
  const operation::ReplayReport report = replayed();
  EXPECT_THAT(report.differences, testing::IsEmpty());
  EXPECT_FALSE(report.finished);
  EXPECT_FALSE(report.complete());
}

TEST_F(AttackedRecord, RecordsAfterTheEndDiffer) {
  records_.push_back(records_.back());
  expect_difference("a record after the end of the operation");
}

TEST_F(AttackedRecord, RecordWithoutAFieldDiffers) {
  content("confirmed").erase("digest");
  expect_difference("\"digest\": is missing");
}

TEST_F(AttackedRecord, RemovedDigestsAreMissing) {
  content("result").erase("files");
  expect_difference("\"files\": is missing");
}

}  // namespace
}  // namespace helicarm::rehearsal
