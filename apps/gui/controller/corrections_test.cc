// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/corrections.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"

namespace helicarm::gui {
namespace corrections_test {

namespace fs = std::filesystem;

class SequenceCorrections : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    ASSERT_TRUE(write_file(
        folder_ / "case.json",
        to_text(Json{
            {"markers", {{"diameter_mm", 1}}},
            {"picks", {pick("J1", "A", 1, 5, 6), pick("J1", "A", 4, 7, 8), pick("J1", "A", 30, 9, 9)}}})));
    case_.markers = {"J1", "J2"};
    for (const char* name : {"A", "B"}) case_.views.emplace_back().images.name = name;
    case_.picks = {{0, 0, {5, 6}}};
    case_.corrections = {{0, 0, {7, 8}, 4}};
  }
  void TearDown() override { fs::remove_all(folder_); }
  static Json pick(const std::string& name, const std::string& view, int frame, double u, double v) {
    return {{"name", name}, {"view", view}, {"frame", frame}, {"uv", {u, v}}};
  }
  Json saved(const Corrections& made) {
    EXPECT_TRUE(made.save(folder_, case_, range_));
    return read_json(folder_ / "case.json")->at("picks");
  }

  const fs::path folder_ =
      fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
  track::TrackCase case_;
  case_registration::FrameRange range_{1, 20, 1};
};

TEST_F(SequenceCorrections, OfALaterFrameStandsBesideThoseOfTheCase) {
  Corrections made(case_);
  made.set({1, 1, {50.5, 60}, 9}, range_);
  EXPECT_EQ(saved(made), Json({pick("J1", "A", 1, 5, 6), pick("J1", "A", 30, 9, 9), pick("J1", "A", 4, 7, 8),
                               pick("J2", "B", 9, 50.5, 60)}));
  made.put_into(case_);
  ASSERT_EQ(case_.corrections.size(), 2u);
  EXPECT_EQ(case_.corrections[1].frame, 9);
}

TEST_F(SequenceCorrections, TakesThePlaceOfAnEarlierOneOfItsFrame) {
  Corrections made(case_);
  made.set({0, 0, {70, 80}, 4}, range_);
  made.put_into(case_);
  ASSERT_EQ(case_.corrections.size(), 1u);
  EXPECT_EQ(case_.corrections[0].uv_raw, Eigen::Vector2d(70, 80));
}

TEST_F(SequenceCorrections, OfTheFirstFrameIsAPickOfIt) {
  Corrections made(case_);
  made.set({0, 0, {5.5, 6.5}, 1}, range_);
  made.put_into(case_);
  EXPECT_EQ(case_.picks, (std::vector<track::MarkerPick>{{0, 0, {5.5, 6.5}}}));
  EXPECT_EQ(saved(made)[0], pick("J1", "A", 1, 5.5, 6.5));
}

TEST_F(SequenceCorrections, AreUndoneOneByOne) {
  Corrections made(case_);
  EXPECT_FALSE(made.can_undo());
  made.set({0, 0, {70, 80}, 4}, range_);
  made.set({1, 1, {50, 60}, 9}, range_);
  made.undo();
  made.undo();
  EXPECT_FALSE(made.can_undo());
  EXPECT_EQ(saved(made),
            Json({pick("J1", "A", 1, 5, 6), pick("J1", "A", 30, 9, 9), pick("J1", "A", 4, 7, 8)}));
}

TEST_F(SequenceCorrections, OfAFolderWithoutACaseFail) {
  fs::remove(folder_ / "case.json");
  EXPECT_FALSE(Corrections(case_).save(folder_, case_, range_));
}

}  // namespace corrections_test
}  // namespace helicarm::gui
