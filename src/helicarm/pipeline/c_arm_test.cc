// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/c_arm.h"

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"

namespace helicarm::pipeline {
namespace {

calibration::CArmHistory record_of(int count) {
  calibration::CArmHistory record;
  for (int i = 0; i < count; ++i) {
    calibration::HistoryEntry entry{std::to_string(i), "AP", {1000, 0.1 * i, 0}, Eigen::Matrix3d::Identity()};
    entry.primary_deg = 10. * i;
    record.entries.push_back(entry);
  }
  return record;
}

TEST(CArm, RecordWithoutOtherAcquisitionsIsRefused) {
  EXPECT_EQ(model_of_record({}, "arm.json").error().reason, Reason::too_few_views);
  const calibration::CArmHistory record = record_of(2);
  const auto checked = check_against_record(record.entries, record, "arm.json");
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::too_few_views);
}

TEST(CArm, ChangeNamesTheWorstAcquisition) {
  const calibration::CArmHistory record = record_of(10);
  std::vector<calibration::HistoryEntry> acquired{record.entries[2], record.entries[5]};
  acquired[0].image = "new a";
  acquired[1].image = "new b";
  acquired[1].view = "LAT";
  acquired[1].estimate_mm.y() += 40;
  const auto check = check_against_record(acquired, record, "arm.json");
  ASSERT_TRUE(check);
  const auto change = c_arm_change(*check);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->reason, Reason::c_arm_changed);
  EXPECT_EQ(change->view, "LAT");
  EXPECT_NEAR(change->figures.at("u0_mm"), 40, 3);
}

TEST(CArm, AcquisitionsOfAnotherArmAreNotAdded) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "arm.json";
  calibration::CArmHistory record = record_of(10);
  ASSERT_EQ(add_to_record(file, {record.entries, {}})->added, 10u);
  calibration::HistoryEntry other = record.entries[5], same = record.entries[4];
  other.image = "other";
  other.estimate_mm.x() += 100;
  EXPECT_EQ(add_to_record(file, CArmAcquisitions{{other}, {}}).error().reason, Reason::c_arm_changed);
  EXPECT_EQ(calibration::read_history(file)->entries.size(), 10u);
  same.image = "same";
  EXPECT_EQ(add_to_record(file, CArmAcquisitions{{same, record.entries[0]}, {}})->added, 1u);
}

TEST(CArm, EntriesOfEarlierVersionsAreComparedFromWhatTheNewImagesState) {
  calibration::CArmHistory record = record_of(10);
  for (calibration::HistoryEntry& entry : record.entries) entry.estimate_mm.x() = 1011;
  calibration::HistoryEntry next = record.entries[5];
  next.image = "next";
  next.nominal_focal_mm = 1000;
  EXPECT_FALSE(check_against_record({next}, record, "arm.json")->changed);
  next.estimate_mm.x() += 120;
  next.nominal_focal_mm = 1120;  // whose deviation such a record does not know
  EXPECT_TRUE(check_against_record({next}, record, "arm.json")->changed);
  record.entries.push_back(next);
  next.image = "another";
  next.estimate_mm.x() -= 120;
  next.nominal_focal_mm = 1000;
  EXPECT_FALSE(check_against_record({next}, record, "arm.json")->changed);
}

TEST(CArm, AnEntryOfAnEarlierVersionTakesWhatItLacksFromItsImage) {
  calibration::CArmHistory record = record_of(3);
  calibration::HistoryEntry same = record.entries[1];
  same.nominal_focal_mm = 990;
  EXPECT_EQ(calibration::add_entries(record, std::vector{same}), 0u);
  EXPECT_EQ(record.entries[1].nominal_focal_mm, 990);
  EXPECT_FALSE(record.entries[0].nominal_focal_mm);
}

TEST(CArm, CheckWithoutAnglesSaysThatItSeesLittle) {
  const calibration::CArmHistory record = record_of(10);
  std::vector<calibration::HistoryEntry> acquired{record.entries[4], record.entries[5]};
  acquired[0].image = "new a";
  acquired[1].image = "new b";
  EXPECT_TRUE(limits_of(*check_against_record(acquired, record, "arm.json")).empty());
  acquired[1].primary_deg.reset();
  const auto limits = limits_of(*check_against_record(acquired, record, "arm.json"));
  ASSERT_EQ(limits.size(), 1u);
  EXPECT_EQ(limits[0].reason, Reason::intrinsics_weak);
  EXPECT_EQ(limits[0].figures.at("acquisitions"), 1);
  EXPECT_GT(limits[0].figures.at("sigma_mm"), 1);
}

TEST(CArm, CheckSaysWhichMapsItDoesNotCompare) {
  calibration::CArmCheck check;
  EXPECT_TRUE(limits_of(check).empty());
  check.uncompared_maps = {"AP", "LAT"};
  EXPECT_TRUE(limits_of(check).empty());  // a record without maps: nothing was expected of them
  for (const std::size_t recorded : {std::size_t{3}, std::size_t{7}}) {
    check.recorded_maps = recorded;
    const auto limits = limits_of(check);
    ASSERT_EQ(limits.size(), 1u);
    EXPECT_EQ(limits[0].reason, Reason::plate_mismatch);
    EXPECT_NE(limits[0].message.find("AP, LAT"), std::string::npos);
    EXPECT_EQ(limits[0].message.find("field") != std::string::npos, recorded == 7);
  }
}

TEST(CArm, UnchangedArmIsNoFailure) {
  const calibration::CArmHistory record = record_of(10);
  std::vector<calibration::HistoryEntry> acquired{record.entries[4]};
  acquired[0].image = "new";
  EXPECT_FALSE(c_arm_change(*check_against_record(acquired, record, "arm.json")));
}

}  // namespace
}  // namespace helicarm::pipeline
