// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/earlier_files.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm {
namespace {

namespace fs = std::filesystem;

TEST(EarlierFiles, AreRemovedAndOthersStay) {
  const TemporaryFolder temporary;
  const fs::path folder = temporary.path();
  for (const char* name : {"map.json", "result.json", "notes.txt"})
    ASSERT_TRUE(write_file(folder / name, "earlier"));
  fs::create_directory(folder / "report.html");
  fs::create_symlink(folder / "notes.txt", folder / "residuals.csv");
  forget_files(folder, {"map.json", "result.json", "report.html", "residuals.csv", "absent"},
               {folder / "." / "map.json"});
  EXPECT_TRUE(fs::exists(folder / "map.json"));  // is read
  EXPECT_FALSE(fs::exists(folder / "result.json"));
  EXPECT_TRUE(fs::exists(folder / "report.html"));  // a folder
  EXPECT_FALSE(fs::exists(folder / "residuals.csv"));
  EXPECT_TRUE(fs::exists(folder / "notes.txt"));
}

TEST(EarlierFiles, OfAFolderThatDoesNotExistAreNone) {
  forget_files("/nowhere", {"a"});
  EXPECT_FALSE(fs::exists("/nowhere"));
}

}  // namespace
}  // namespace helicarm
