// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/private_files.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm {
namespace {

namespace fs = std::filesystem;

constexpr fs::perms owner_reads_and_writes = fs::perms::owner_read | fs::perms::owner_write;

class PrivateFiles : public testing::Test {
 protected:
  static fs::perms mode(const fs::path& path) { return fs::status(path).permissions(); }

  TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path() / "a" / "b", file_ = folder_ / "image.dcm";
};

TEST_F(PrivateFiles, FolderAndFileAreTheOwnersOnly) {
  ASSERT_TRUE(make_private_folder(folder_ / ""));
  ASSERT_TRUE(write_private_file(file_, "pixels"));
  EXPECT_EQ(mode(folder_), fs::perms::owner_all);
  EXPECT_EQ(mode(file_), owner_reads_and_writes);
  EXPECT_EQ(*read_file(file_, 10), "pixels");
}

TEST_F(PrivateFiles, FileThatOthersMayReadBecomesPrivate) {
  ASSERT_TRUE(write_file(file_, "earlier"));
  ASSERT_TRUE(write_private_file(file_, "pixels"));
  EXPECT_EQ(mode(file_), owner_reads_and_writes);
  fs::permissions(file_, fs::perms::others_read, fs::perm_options::add);
  ASSERT_TRUE(make_private_file(file_));
  EXPECT_EQ(mode(file_), owner_reads_and_writes);
  EXPECT_EQ(fs::file_size(file_), 0u);
}

TEST_F(PrivateFiles, FolderThatExistsKeepsItsMode) {
  fs::create_directories(folder_);
  const fs::perms before = mode(folder_);
  ASSERT_TRUE(make_private_folder(folder_));
  EXPECT_EQ(mode(folder_), before);
}

TEST_F(PrivateFiles, FolderUnderAFileIsRefused) {
  ASSERT_TRUE(write_file(temporary_.path() / "a", ""));
  EXPECT_EQ(make_private_folder(folder_).error().reason, Reason::cannot_write);
  EXPECT_EQ(write_private_file(file_, "pixels").error().reason, Reason::cannot_write);
}

}  // namespace
}  // namespace helicarm
