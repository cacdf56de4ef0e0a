// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/inbox.h"

#include <fstream>

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::receiver {
namespace {

namespace fs = std::filesystem;

class InboxOnDisk : public testing::Test {
 protected:
  TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  std::unique_ptr<Inbox> inbox_ = Inbox::open(folder_).value();
};

TEST_F(InboxOnDisk, ImageIsStoredUnchanged) {
  const std::string file = xray::DicomBuilder().bytes();
  const Arrival arrival = inbox_->store(file, "test").value();
  EXPECT_EQ(arrival.path, folder_ / "2.25.17.dcm");
  EXPECT_EQ(read_file(arrival.path, 1 << 20).value(), file);
  EXPECT_FALSE(arrival.repeated);
}

TEST_F(InboxOnDisk, SameImageAgainIsTheSameArrival) {
  inbox_->store(xray::DicomBuilder().bytes(), "test").value();
  const Arrival again = inbox_->store(xray::DicomBuilder().bytes(), "test").value();
  EXPECT_TRUE(again.repeated);
  EXPECT_TRUE(again.warnings.empty());
  EXPECT_FALSE(fs::exists(folder_ / "2.25.17~2.dcm"));
}

TEST_F(InboxOnDisk, SameImageInAnotherTransferSyntaxIsTheSameArrival) {
  inbox_->store(xray::DicomBuilder().bytes(), "test").value();
  const Arrival again =
      inbox_->store(xray::DicomBuilder().syntax("1.2.840.10008.1.2").bytes(), "test").value();
  EXPECT_TRUE(again.repeated);
  EXPECT_TRUE(again.warnings.empty());
}

TEST_F(InboxOnDisk, OtherPixelsInAnotherTransferSyntaxAreAnotherImage) {
  inbox_->store(xray::DicomBuilder().bytes(), "test").value();
  const std::string other =
      xray::DicomBuilder().syntax("1.2.840.10008.1.2").pixels(std::vector<std::uint16_t>(48, 7)).bytes();
  const Arrival arrival = inbox_->store(other, "test").value();
  EXPECT_FALSE(arrival.repeated);
  EXPECT_EQ(arrival.warnings.size(), 1u);
}

TEST_F(InboxOnDisk, OtherBytesUnderOneUidAreBothKeptWithAWarning) {
  inbox_->store(xray::DicomBuilder().bytes(), "test").value();
  const std::string other = xray::DicomBuilder().text(0x00181110, "DS", "990").bytes();
  const Arrival arrival = inbox_->store(other, "test").value();
  EXPECT_EQ(arrival.path, folder_ / "2.25.17~2.dcm");
  ASSERT_EQ(arrival.warnings.size(), 1u);
  EXPECT_EQ(arrival.warnings[0].reason, Reason::uid_reused);
  EXPECT_TRUE(inbox_->store(other, "test").value().repeated);
  EXPECT_EQ(read_file(folder_ / "2.25.17.dcm", 1 << 20).value(), xray::DicomBuilder().bytes());
}

TEST_F(InboxOnDisk, UnreadableImageIsRefusedAndLeavesNothing) {
  EXPECT_EQ(inbox_->store("hello", "test").error().reason, Reason::not_an_image);
  EXPECT_FALSE(inbox_->store(xray::DicomBuilder().word(0x00280010, 65535).bytes(), "test"));
  EXPECT_FALSE(inbox_->store(xray::DicomBuilder().text(0x00181164, "DS", "-1\\-1").bytes(), "test"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);  // only the lock file
}

TEST_F(InboxOnDisk, InvalidUidIsRefused) {
  EXPECT_EQ(inbox_->store(xray::DicomBuilder().text(0x00080018, "UI", "..").bytes(), "test").error().reason,
            Reason::bad_value);
}

TEST_F(InboxOnDisk, NoMessageContainsThePatientName) {
  const auto refused = inbox_->store(
      xray::DicomBuilder().text(0x00100010, "PN", "CANARY^NAME").word(0x00280010, 0).bytes(), "test");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message.find("CANARY"), std::string::npos);
}

TEST_F(InboxOnDisk, SecondProgramIsRefused) {
  const auto second = Inbox::open(folder_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, Reason::cannot_write);
  inbox_.reset();
  EXPECT_TRUE(Inbox::open(folder_));
}

TEST_F(InboxOnDisk, FolderDeletedInOperationIsAnErrorAndNotRecreated) {
  fs::remove_all(folder_);
  const auto refused = inbox_->store(xray::DicomBuilder().bytes(), "test");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::cannot_write);
  EXPECT_FALSE(fs::exists(folder_));
}

TEST_F(InboxOnDisk, FolderReplacedInOperationIsAnErrorAndStaysEmpty) {
  fs::remove_all(folder_);
  fs::create_directory(folder_);
  EXPECT_EQ(inbox_->store(xray::DicomBuilder().bytes(), "test").error().reason, Reason::cannot_write);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(InboxOnDisk, LockDeletedInOperationIsAnError) {
  fs::remove(folder_ / ".lock");
  EXPECT_EQ(inbox_->store(xray::DicomBuilder().bytes(), "test").error().reason, Reason::cannot_write);
}

TEST_F(InboxOnDisk, IncompleteImagesOfAKilledProgramAreRemoved) {
  inbox_.reset();
  std::ofstream(folder_ / ".2.25.17.dcm.123.0.part") << "half";
  inbox_ = Inbox::open(folder_).value();
  EXPECT_FALSE(fs::exists(folder_ / ".2.25.17.dcm.123.0.part"));
}

TEST(Inbox, FolderThatCannotBeCreatedIsRefused) {
  EXPECT_EQ(Inbox::open("/dev/null/inbox").error().reason, Reason::cannot_write);
}

}  // namespace
}  // namespace helicarm::receiver
