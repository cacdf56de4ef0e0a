// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/file_lock.h"

#include <fstream>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm {
namespace {

namespace fs = std::filesystem;

class LockedFile : public testing::Test {
 protected:
  /// Reads, waits and replaces: without a lock others' additions are lost.
  static void add_one(const fs::path& file) {
    const FileLock lock = FileLock::of(file).value();
    const int count = std::stoi(read_file(lock.file(), 100).value());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::ofstream(lock.file()) << count + 1;
  }
  void SetUp() override { ASSERT_TRUE(write_file(file_, "0")); }

  TemporaryFolder temporary_;
  const fs::path file_ = temporary_.path() / "count.txt";
};

TEST_F(LockedFile, ThreadsLoseNothing) {
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 8; ++i)
      threads.emplace_back([&] {
        for (int j = 0; j < 10; ++j) add_one(file_);
      });
  }
  EXPECT_EQ(*read_file(file_, 100), "80");
  EXPECT_EQ(std::distance(fs::directory_iterator(temporary_.path()), fs::directory_iterator()), 1);
}

TEST_F(LockedFile, ProgramsLoseNothing) {
  std::vector<pid_t> children;
  for (int i = 0; i < 6; ++i) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (int j = 0; j < 10; ++j) add_one(file_);
      ::_exit(0);
    }
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(*read_file(file_, 100), "60");
}

TEST_F(LockedFile, NamedThroughALinkIsTheSameFile) {
  const fs::path link = temporary_.path() / "link.txt";
  fs::create_symlink(file_, link);
  add_one(link);
  add_one(file_);
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(*read_file(link, 100), "2");
}

TEST_F(LockedFile, WithoutItsFolderIsRefused) {
  EXPECT_EQ(FileLock::of(temporary_.path() / "none" / "a.txt").error().reason, Reason::cannot_write);
  EXPECT_EQ(FileLock::of(temporary_.path()).error().reason, Reason::cannot_write);
}

}  // namespace
}  // namespace helicarm
