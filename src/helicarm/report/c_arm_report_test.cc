// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/c_arm_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::report {
namespace {

using testing::HasSubstr;

calibration::CArmModel model() {
  std::vector<calibration::HistoryEntry> entries;
  for (const double angle : {-40., 0., 40., 90.}) {
    calibration::HistoryEntry entry{
        std::to_string(angle), "A<B", {1000 + angle / 100, 1, -1}, Eigen::Matrix3d::Identity()};
    entry.primary_deg = angle;
    entry.date = "2026-01-02";
    entries.push_back(entry);
  }
  return calibration::c_arm_model(
      entries, {1000, 0, 0},
      {calibration::IntrinsicsVariation{10, 1.4}, calibration::IntrinsicsVariation{7, 4.2}});
}

TEST(CArmReport, FilesHoldEveryAcquisition) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_c_arm_report(c_arm_findings(model()), folder.path()));
  const std::string page = *read_file(folder.path() / "report.html", 1 << 24);
  EXPECT_THAT(page, HasSubstr("A&lt;B"));
  EXPECT_THAT(page, HasSubstr("<svg"));
  const std::string pdf = *read_file(folder.path() / "report.pdf", 1 << 24);
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  EXPECT_THAT(pdf, HasSubstr("(A<B)"));
  EXPECT_THAT(pdf, HasSubstr("(Signature)"));
  const std::string csv = *read_file(folder.path() / "c_arm.csv", 1 << 24);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
  EXPECT_THAT(csv, HasSubstr("A<B,2026-01-02,90,,1000.9"));
}

TEST(CArmReport, VariationsHaveIntervals) {
  const Json json = to_json(c_arm_findings(model()));
  for (const char* kind : {"focal_mm", "principal_mm"})
    for (const char* name : {"smooth_95", "repeat_95"})
      EXPECT_EQ(json[kind][name].size(), 2U) << kind << name;
  EXPECT_EQ(json["at_positions_mm"]["focal"].size(), 2U);
  const std::string text = c_arm_text(c_arm_findings(model()));
  EXPECT_THAT(
      text, HasSubstr("4 acquisitions; standard deviations (95 %):\n  source distance: over the positions"));
  EXPECT_THAT(text, HasSubstr("predicted at the recorded positions, mm: focal "));
}

TEST(CArmReport, OfOneAcquisitionTheVariationsAreNotDetermined) {
  calibration::CArmModel one = model();
  one.entries.resize(1);
  one.entries[0].primary_deg.reset();
  const Json json = to_json(c_arm_findings(one));
  EXPECT_TRUE(json["focal_mm"]["smooth"].is_null());
  EXPECT_TRUE(json["at_positions_mm"].is_null());
  EXPECT_THAT(c_arm_text(c_arm_findings(one)), HasSubstr("not determined by these data"));
}

TEST(CArmReport, RunsHaveTheirIsocentreAndDaysTheirDrift) {
  calibration::CArmModel recorded = model();
  recorded.entries.back().date = "2026-07-02";
  recorded.runs.push_back({"digest", "2026-07-02", 133, 200, 1.25, {0.1, 0.1, 0.1}, 620});
  const std::string text = c_arm_text(c_arm_findings(recorded));
  EXPECT_THAT(text, HasSubstr("farthest central ray 1.25 to 1.25 mm off it, in 1 run\n"));
  EXPECT_THAT(text, HasSubstr("drift, mm a year (95 %): focal "));
  const TemporaryFolder folder;
  ASSERT_TRUE(write_c_arm_report(c_arm_findings(recorded), folder.path()));
  EXPECT_THAT(*read_file(folder.path() / "report.html", 1 << 24), HasSubstr("source to axis mm"));
  EXPECT_THAT(*read_file(folder.path() / "c_arm_runs.csv", 1 << 24),
              HasSubstr("\n2026-07-02,133,200.0000,1.2500,0.1000,0.1000,0.1000,620.0000\n"));
  EXPECT_EQ(to_json(c_arm_findings(recorded))["runs"].size(), 1U);
  EXPECT_TRUE(to_json(c_arm_findings(model()))["drift"].is_null());
}

TEST(CArmReport, WithoutAnglesThereIsNoCurve) {
  calibration::CArmModel without = model();
  for (calibration::HistoryEntry& entry : without.entries) entry.primary_deg.reset();
  const TemporaryFolder folder;
  ASSERT_TRUE(write_c_arm_report(c_arm_findings(model()), folder.path()));
  ASSERT_TRUE(write_c_arm_report(c_arm_findings(without), folder.path()));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "c_arm.svg"));
}

}  // namespace
}  // namespace helicarm::report
