// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"

#include <csignal>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
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

TEST_F(Files, PrivateFileStaysPrivateWhenItIsReplaced) {
  const fs::path file = folder_ / "b.txt";
  const auto owner_only = fs::perms::owner_read | fs::perms::owner_write;
  ASSERT_TRUE(write_file(file, "old"));
  EXPECT_NE(fs::status(file).permissions(), owner_only);
  fs::permissions(file, owner_only);
  ASSERT_TRUE(write_file(file, "new"));
  EXPECT_EQ(fs::status(file).permissions(), owner_only);
  ASSERT_TRUE(write_file_with(file, [](const fs::path& aside) -> Expected<void> {
    std::ofstream(aside) << "newer";
    return {};
  }));
  EXPECT_EQ(fs::status(file).permissions(), owner_only);
  EXPECT_EQ(*read_file(file, 10), "newer");
}

TEST_F(Files, KilledWriterLeavesNothing) {
  const pid_t writer = ::fork();
  if (writer == 0) {
    (void)write_file_with(folder_ / "b.txt", [](const fs::path& aside) -> Expected<void> {
      std::ofstream(aside) << "half";
      std::raise(SIGKILL);
      return {};
    });
    ::_exit(1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(writer, &status, 0), writer);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_TRUE(fs::is_empty(folder_));
}

/// A full disk ends a write in the same place, by another number.
TEST_F(Files, FailureNamesTheSystemsCause) {
  ASSERT_TRUE(write_file(folder_ / "b.txt", "old"));
  struct rlimit before {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const struct rlimit small { 1000, before.rlim_max };
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto result = write_file(folder_ / "b.txt", std::string(5000, 'x'));
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::cannot_write);
  EXPECT_NE(result.error().message.find("b.txt: cannot be written: File too large"), std::string::npos)
      << result.error().message;
  EXPECT_EQ(*read_file(folder_ / "b.txt", 10), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(Files, FolderThatCannotBeCreatedNamesTheCause) {
  ASSERT_TRUE(write_file(folder_ / "file", "x"));
  const auto result = write_file(folder_ / "file" / "sub" / "b.txt", "hello");
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("Not a directory"), std::string::npos) << result.error().message;
}

TEST_F(Files, WritingIsCheckedWithoutMakingAFolder) {
  EXPECT_TRUE(check_can_write(folder_ / "new/deeper"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "new"));
  EXPECT_TRUE(check_can_write({}));
  ASSERT_TRUE(write_file(folder_ / "file", "x"));
  for (const auto& path : {folder_ / "file", folder_ / "file/below"}) {
    const auto refused = check_can_write(path);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().reason, Reason::cannot_write);
    EXPECT_EQ(refused.error().message, (folder_ / "file").string() + ": is not a folder");
  }
}

TEST_F(Files, PathsOfWindowsAreNamed) {
  for (const char* name : {"C:\\data\\AP.dcm", "c:/data/AP.dcm", "\\\\server\\AP.dcm"}) {
    const auto refused = path_inside(folder_, name);
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().reason, Reason::path_outside);
    EXPECT_NE(refused.error().message.find("Windows"), std::string::npos);
  }
  const auto refused = path_inside(folder_, "images\\AP.dcm");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("write / instead"), std::string::npos);
  ASSERT_TRUE(write_file(folder_ / "a\\b", "x"));
  EXPECT_TRUE(path_inside(folder_, "a\\b"));
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

TEST_F(Files, OfAFolderInPlaceOfAFileItsJsonFilesAreNamed) {
  ASSERT_TRUE(write_file(folder_ / "run/sweep.json", "{}"));
  EXPECT_NE(read_file(folder_ / "run", 4).error().message.find("it holds sweep.json"), std::string::npos);
}

TEST_F(Files, PathsThatLeaveTheFolderAreRefused) {
  fs::create_directory_symlink("/", folder_ / "link");
  for (const char* name : {"../x", "/etc/passwd", "a/../../x", "link/etc/passwd"})
    EXPECT_EQ(path_inside(folder_, name).error().reason, Reason::path_outside) << name;
  EXPECT_TRUE(path_inside(folder_, "sub/../x.dcm").has_value());
}

}  // namespace
}  // namespace helicarm
