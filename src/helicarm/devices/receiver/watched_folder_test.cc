// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/watched_folder.h"

#include <fstream>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/xray/dicom_builder.h"

namespace helicarm {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

class FolderOnDisk : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "helicarm_watched_XXXXXX").string();
    ASSERT_TRUE(mkdtemp(name.data()));
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  void put(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }

  fs::path folder_;
};

TEST_F(FolderOnDisk, FileIsTakenOnceItIsSeenUnchanged) {
  FolderLook look(folder_);
  put("a", "half");
  EXPECT_THAT(look.at_rest(), IsEmpty());
  put("a", "half and half");
  EXPECT_THAT(look.at_rest(), IsEmpty());
  EXPECT_THAT(look.at_rest(), ElementsAre(folder_ / "a"));
  EXPECT_THAT(look.at_rest(), IsEmpty());
}

TEST_F(FolderOnDisk, FileWrittenAnewIsTakenAgain) {
  FolderLook look(folder_);
  put("a", "one");
  look.at_rest();
  EXPECT_THAT(look.at_rest(), ElementsAre(folder_ / "a"));
  put("a", "another");
  look.at_rest();
  EXPECT_THAT(look.at_rest(), ElementsAre(folder_ / "a"));
}

TEST_F(FolderOnDisk, LinksFoldersAndHiddenFilesAreLeft) {
  FolderLook look(folder_);
  put(".part", "x");
  fs::create_directory(folder_ / "sub");
  fs::create_symlink("/dev/zero", folder_ / "link");
  look.at_rest();
  EXPECT_THAT(look.at_rest(), IsEmpty());
}

TEST_F(FolderOnDisk, FolderThatIsAwayAndComesBackIsNoError) {
  FolderLook look(folder_ / "share");
  EXPECT_THAT(look.at_rest(), IsEmpty());
  fs::create_directory(folder_ / "share");
  put("share/a", "x");
  look.at_rest();
  EXPECT_EQ(look.at_rest().size(), 1u);
}

TEST_F(FolderOnDisk, PictureGoesToTheInboxAndTheFileStays) {
  const auto inbox = Inbox::open(folder_ / "inbox").value();
  fs::create_directory(folder_ / "share");
  std::promise<Arrival> arrived;
  const WatchedFolder watched(folder_ / "share", *inbox,
                              {[&](const Arrival& a) { arrived.set_value(a); }, [](const Failure&) {}},
                              std::chrono::milliseconds(5));
  put("share/knee", DicomBuilder().bytes());
  EXPECT_EQ(arrived.get_future().get().path, folder_ / "inbox" / "2.25.17.dcm");
  EXPECT_TRUE(fs::exists(folder_ / "share/knee"));
}

}  // namespace
}  // namespace helicarm
