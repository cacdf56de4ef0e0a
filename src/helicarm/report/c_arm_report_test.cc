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
  ASSERT_TRUE(write_c_arm_report(model(), folder.path()));
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
  const Json json = to_json(model());
  for (const char* kind : {"focal_mm", "principal_mm"})
    for (const char* name : {"smooth_95", "repeat_95"})
      EXPECT_EQ(json[kind][name].size(), 2U) << kind << name;
  EXPECT_EQ(json["at_positions_mm"]["focal"].size(), 2U);
  const std::string text = c_arm_text(model());
  EXPECT_THAT(
      text, HasSubstr("4 acquisitions; standard deviations (95 %):\n  source distance: over the positions"));
  EXPECT_THAT(text, HasSubstr("predicted at the recorded positions, mm: focal "));
}

TEST(CArmReport, OfOneAcquisitionTheVariationsAreNotDetermined) {
  calibration::CArmModel one = model();
  one.entries.resize(1);
  one.entries[0].primary_deg.reset();
  const Json json = to_json(one);
  EXPECT_TRUE(json["focal_mm"]["smooth"].is_null());
  EXPECT_TRUE(json["at_positions_mm"].is_null());
  EXPECT_THAT(c_arm_text(one), HasSubstr("not determined by these data"));
}

TEST(CArmReport, WithoutAnglesThereIsNoCurve) {
  calibration::CArmModel without = model();
  for (calibration::HistoryEntry& entry : without.entries) entry.primary_deg.reset();
  const TemporaryFolder folder;
  ASSERT_TRUE(write_c_arm_report(model(), folder.path()));
  ASSERT_TRUE(write_c_arm_report(without, folder.path()));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "c_arm.svg"));
}

}  // namespace
}  // namespace helicarm::report
