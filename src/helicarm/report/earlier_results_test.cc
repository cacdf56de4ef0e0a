// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/earlier_results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::report {
namespace {

namespace fs = std::filesystem;

class EarlierResults : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& content = "earlier") const {
    ASSERT_TRUE(write_file(folder() / name, content));
  }
  std::vector<std::string> left() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder()))
      names.push_back(fs::relative(entry.path(), folder()).string());
    return names;
  }
  const fs::path& folder() const { return temporary_.path(); }

  TemporaryFolder temporary_;
};

TEST_F(EarlierResults, OfARunWithModelsAreRemovedAndOthersStay) {
  write("result.json", to_text(Json{{"views", {{{"name", "AP"}}, {{"name", "LAT"}}}}}));
  const Json registration = {{"models", {{{"name", "femur"}, {"views", {{{"name", "OBL"}}}}}}}};
  for (const char* name : {"registration.json", "registration/registration.json"})
    write(name, to_text(registration));
  for (const char* name : {"AP_overlay.png", "LAT_overlay.png", "OBL_overlay.png", "report.html",
                           "registration/OBL_overlay.png", "registration/report.html", "my_overlay.png"})
    write(name);
  forget_results(folder());
  EXPECT_THAT(left(), testing::ElementsAre("my_overlay.png"));
}

TEST_F(EarlierResults, OfASequenceAreRemoved) {
  for (const char* name : {"registration.csv", "relative.csv", "result.json"}) write(name);
  forget_registration(folder());
  EXPECT_THAT(left(), testing::ElementsAre("result.json"));
}

TEST_F(EarlierResults, ThatCannotBeReadAreRemoved) {
  write("result.json", "{");
  write("registration.json", R"({"models": [1, {"views": 2}], "views": [{"name": 3}]})");
  forget_results(folder());
  EXPECT_THAT(left(), testing::IsEmpty());
}

TEST_F(EarlierResults, FolderOfModelsWithAForeignFileStays) {
  write("registration/notes.txt");
  forget_results(folder());
  EXPECT_THAT(left(), testing::UnorderedElementsAre("registration", "registration/notes.txt"));
}

}  // namespace
}  // namespace helicarm::report
