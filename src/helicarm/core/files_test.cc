// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"

#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace helicarm {
namespace {
namespace fs = std::filesystem;

class Files : public ::testing::Test {
 protected:
  Files() : folder_(fs::temp_directory_path() / ("helicarm_files_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~Files() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(Files, RoundTripKeepsContent) {
  ASSERT_TRUE(write_file(folder_ / "a" / "b.txt", "hello"));
  EXPECT_EQ(*read_file(folder_ / "a" / "b.txt", 10), "hello");
}

TEST_F(Files, FailedWriteKeepsTheOldFileAndLeavesNoOther) {
  ASSERT_TRUE(write_file(folder_ / "b.txt", "old"));
  const auto result = write_file_with(folder_ / "b.txt", [](const fs::path& aside) -> Expected<void> {
    std::ofstream(aside) << "half";
    return fail(Reason::cannot_write, "simulated failure");
  });
  EXPECT_FALSE(result.has_value());
  EXPECT_EQ(*read_file(folder_ / "b.txt", 10), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(Files, WriteFileInFolderDoesNotCreateTheFolder) {
  EXPECT_EQ(write_file_in_folder(folder_ / "a" / "b.txt", "hello").error().reason, Reason::cannot_write);
  EXPECT_FALSE(fs::exists(folder_ / "a"));
  ASSERT_TRUE(write_file_in_folder(folder_ / "b.txt", "hello"));
  EXPECT_EQ(*read_file(folder_ / "b.txt", 10), "hello");
}

TEST_F(Files, FileOverTheLimitIsNotRead) {
  ASSERT_TRUE(write_file(folder_ / "b.txt", "hello"));
  EXPECT_EQ(read_file(folder_ / "b.txt", 4).error().reason, Reason::bad_size);
}

TEST_F(Files, MissingFileAndFolderAreNamed) {
  EXPECT_EQ(read_file(folder_ / "none", 4).error().reason, Reason::missing_file);
  EXPECT_EQ(read_file(folder_, 4).error().reason, Reason::missing_file);
}

TEST_F(Files, PathsThatLeaveTheFolderAreRefused) {
  fs::create_directory_symlink("/", folder_ / "link");
  for (const char* name : {"../x", "/etc/passwd", "a/../../x", "link/etc/passwd"})
    EXPECT_EQ(path_inside(folder_, name).error().reason, Reason::path_outside) << name;
  EXPECT_TRUE(path_inside(folder_, "sub/../x.dcm").has_value());
}

}  // namespace
}  // namespace helicarm
