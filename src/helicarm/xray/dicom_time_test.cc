// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_time.h"

#include <gtest/gtest.h>

#include "helicarm/xray/dicom_builder.h"

namespace helicarm::xray {
namespace {

constexpr std::uint32_t acquisition_date_time = 0x0008002A, acquisition_date = 0x00080022,
                        acquisition_time_of_day = 0x00080032, content_date = 0x00080023,
                        content_time = 0x00080033, timezone = 0x00080201;
/// 2026-02-28 23:59:58 UTC.
constexpr double late_in_february = 1772323198;

std::optional<AcquisitionTime> read(const DicomBuilder& builder) {
  const std::string bytes = builder.bytes();
  return acquisition_time(walk_dicom(bytes, "x.dcm").value());
}

DicomBuilder dated(const std::string& date_time) {
  return DicomBuilder().text(acquisition_date_time, "DT", date_time);
}

TEST(DicomTime, DateTimeWithItsOffset) {
  const auto time = read(dated("20260301005958.25+0100"));
  ASSERT_TRUE(time);
  EXPECT_DOUBLE_EQ(time->seconds, late_in_february + 0.25);
  EXPECT_DOUBLE_EQ(time->resolution_s, 0.01);
}

TEST(DicomTime, OffsetOfTheImageAppliesToTimesWithoutOne) {
  EXPECT_DOUBLE_EQ(read(dated("20260228225958").text(timezone, "SH", "-0100"))->seconds, late_in_february);
  EXPECT_NE(read(dated("20260228235958"))->source, read(dated("20260228235958+0000"))->source);
}

TEST(DicomTime, DateAndTimeElseContentDateAndTime) {
  DicomBuilder content =
      DicomBuilder().text(content_date, "DA", "20260228").text(content_time, "TM", "235958");
  EXPECT_DOUBLE_EQ(read(content)->seconds, late_in_february);
  EXPECT_EQ(read(content)->source, "Content Date and Time");
  content.text(acquisition_date, "DA", "20260228").text(acquisition_time_of_day, "TM", "235957.500000");
  EXPECT_DOUBLE_EQ(read(content)->seconds, late_in_february - 0.5);
  EXPECT_EQ(read(content)->source, "Acquisition Date and Time");
}

TEST(DicomTime, WholeSecondsHaveOneSecondResolution) {
  EXPECT_EQ(read(dated("20260228235958"))->resolution_s, 1);
  EXPECT_EQ(read(dated("20260228235958.000"))->resolution_s, 1);
}

TEST(DicomTime, InvalidTimesAreAbsent) {
  EXPECT_FALSE(read(DicomBuilder()));
  for (const char* time : {"20260228", "202602282359", "20260229000000", "20261301000000", "20260228240000",
                           "20260228236000", "20260228235958.", "20260228235958.1234567", "2026022823595x",
                           "20260228235958+01", "20260228235958Z", "-0260228235958", "2026.02.28235958"})
    EXPECT_FALSE(read(dated(time))) << time;
}

TEST(DicomTime, IsWrittenAsItWasStated) {
  const auto rewritten = [](const char* stated) {
    const WrittenTime time = written_time(*read(dated(stated)));
    EXPECT_FALSE(time.is_of_content);
    return time.date + time.time + time.offset;
  };
  EXPECT_EQ(rewritten("20260228235958"), "20260228235958");
  EXPECT_EQ(rewritten("20260228235958.25"), "20260228235958.25");
  EXPECT_EQ(rewritten("20260228235958.123456"), "20260228235958.123456");
  EXPECT_EQ(rewritten("20260301005958.5+0100"), "20260228235958.5+0000");
}

TEST(DicomTime, WrittenTimeRoundTrips) {
  for (const double seconds : {0.25, late_in_february + 0.123456, 4e9})
    EXPECT_NEAR(read(dated(dicom_date_time(seconds)))->seconds, seconds, 1e-6);
}

}  // namespace
}  // namespace helicarm::xray
