// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/recent.h"

#include <QTemporaryDir>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::gui {
namespace {
namespace fs = std::filesystem;

class Recent : public testing::Test {
 protected:
  fs::path made(const std::string& name) const {
    const fs::path path = fs::canonical(root_.path().toStdString()) / name;
    fs::create_directories(path);
    return path;
  }

  QTemporaryDir root_;
  QSettings settings_{root_.filePath("settings.ini"), QSettings::IniFormat};
};

TEST_F(Recent, NewestIsFirstWithoutDuplicates) {
  const fs::path a = made("a"), b = made("b b");
  for (const fs::path& folder : {a, b, a / "", b / ".." / "a"})
    remember_folder(settings_, Folder::cases, folder);
  EXPECT_THAT(recent_folders(settings_, Folder::cases), testing::ElementsAre(a, b));
  EXPECT_TRUE(recent_folders(settings_, Folder::sessions).empty());
}

TEST_F(Recent, TenAreKept) {
  for (int i = 0; i < 12; ++i) remember_folder(settings_, Folder::sessions, made(std::to_string(i)));
  const auto folders = recent_folders(settings_, Folder::sessions);
  ASSERT_EQ(folders.size(), 10u);
  EXPECT_EQ(folders.front().filename(), "11");
  EXPECT_EQ(folders.back().filename(), "2");
}

TEST_F(Recent, MissingFolderIsDropped) {
  const fs::path a = made("a"), b = made("b");
  remember_folder(settings_, Folder::cases, a);
  remember_folder(settings_, Folder::cases, b);
  fs::remove(a);
  EXPECT_THAT(recent_folders(settings_, Folder::cases), testing::ElementsAre(b));
}

TEST_F(Recent, PersistsUntilCleared) {
  const fs::path a = made("a");
  remember_folder(settings_, Folder::cases, a);
  settings_.sync();
  QSettings again(root_.filePath("settings.ini"), QSettings::IniFormat);
  EXPECT_THAT(recent_folders(again, Folder::cases), testing::ElementsAre(a));
  forget_folders(again, Folder::cases);
  EXPECT_TRUE(recent_folders(again, Folder::cases).empty());
}

}  // namespace
}  // namespace helicarm::gui
