// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/watched_folder.h"

#include <fstream>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::receiver {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

class FolderOnDisk : public testing::Test {
 protected:
  void put(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }

  TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

TEST_F(FolderOnDisk, FileIsTakenOnceUnchanged) {
  FolderScan scan(folder_);
  put("a", "half");
  EXPECT_THAT(scan.unchanged_files(), IsEmpty());
  put("a", "half and half");
  EXPECT_THAT(scan.unchanged_files(), IsEmpty());
  EXPECT_THAT(scan.unchanged_files(), ElementsAre(folder_ / "a"));
  EXPECT_THAT(scan.unchanged_files(), IsEmpty());
}

TEST_F(FolderOnDisk, ModifiedFileIsTakenAgain) {
  FolderScan scan(folder_);
  put("a", "one");
  scan.unchanged_files();
  EXPECT_THAT(scan.unchanged_files(), ElementsAre(folder_ / "a"));
  put("a", "another");
  scan.unchanged_files();
  EXPECT_THAT(scan.unchanged_files(), ElementsAre(folder_ / "a"));
}

TEST_F(FolderOnDisk, LinksFoldersAndHiddenFilesAreIgnored) {
  FolderScan scan(folder_);
  put(".part", "x");
  fs::create_directory(folder_ / "sub");
  fs::create_symlink("/dev/zero", folder_ / "link");
  scan.unchanged_files();
  EXPECT_THAT(scan.unchanged_files(), IsEmpty());
}

TEST_F(FolderOnDisk, MissingFolderThatReturnsIsNotAnError) {
  FolderScan scan(folder_ / "share");
  EXPECT_THAT(scan.unchanged_files(), IsEmpty());
  fs::create_directory(folder_ / "share");
  put("share/a", "x");
  scan.unchanged_files();
  EXPECT_EQ(scan.unchanged_files().size(), 1u);
}

TEST_F(FolderOnDisk, ImageGoesToTheInboxAndTheFileStays) {
  const auto inbox = Inbox::open(folder_ / "inbox").value();
  fs::create_directory(folder_ / "share");
  std::promise<Arrival> arrived;
  const WatchedFolder watched({folder_ / "share", std::chrono::milliseconds(5)}, *inbox,
                              {[&](const Arrival& a) { arrived.set_value(a); }, [](const Failure&) {}});
  put("share/knee", xray::DicomBuilder().bytes());
  EXPECT_EQ(arrived.get_future().get().path, folder_ / "inbox" / "2.25.17.dcm");
  EXPECT_TRUE(fs::exists(folder_ / "share/knee"));
}

TEST_F(FolderOnDisk, AtMostTheRequestedNumberOfImagesIsTaken) {
  const auto inbox = Inbox::open(folder_ / "inbox").value();
  fs::create_directory(folder_ / "share");
  put("share/one", xray::DicomBuilder().bytes());
  put("share/two", xray::DicomBuilder().text(0x00080018, "UI", "2.25.18").bytes());
  std::promise<void> arrived;
  {
    const WatchedFolder watched({folder_ / "share", std::chrono::milliseconds(5), 1}, *inbox,
                                {[&](const Arrival&) { arrived.set_value(); }, [](const Failure&) {}});
    arrived.get_future().wait();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  const auto kept = std::ranges::count_if(fs::directory_iterator(folder_ / "inbox"), [](const auto& entry) {
    return entry.path().extension() == ".dcm";
  });
  EXPECT_EQ(kept, 1);
}

}  // namespace
}  // namespace helicarm::receiver
