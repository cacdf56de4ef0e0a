// SPDX-License-Identifier: Apache-2.0
// Enhanced XA images: what a file of one frame states at top level stands in functional groups.
#include <gtest/gtest.h>

#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

std::string text(std::uint32_t tag, const char* vr, std::string value) {
  if (value.size() % 2 != 0) value += ' ';
  return DicomBuilder::element(tag, vr, value, true);
}

std::string group(std::uint32_t tag, const std::string& content) {
  return DicomBuilder::element(tag, "SQ", DicomBuilder::item(content), true);
}

std::string positioner(const std::string& primary) {
  return group(0x00189405, text(0x00181510, "DS", primary) + text(0x00181511, "DS", "-2"));
}

/// Two frames of 8 x 6 pixels at different angles.
DicomBuilder enhanced() {
  DicomBuilder builder;
  builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.12.1.1").text(0x00280008, "IS", "2");
  builder.erase(0x00181110).erase(0x00181164);
  std::vector<std::uint16_t> values;
  for (std::uint16_t i = 0; i < 96; ++i) values.push_back(static_cast<std::uint16_t>(100 + i));
  builder.pixels(values);
  builder.raw(0x52009229, "SQ",
              DicomBuilder::item(
                  group(0x00189432, text(0x00187034, "CS", "YES")) +
                  group(0x00189476, text(0x00181110, "DS", "1020")) +
                  group(0x00289443, text(0x00181164, "DS", "0.3\\0.2") + text(0x00281040, "CS", "LOG"))));
  builder.raw(
      0x52009230, "SQ",
      DicomBuilder::item(positioner("10") + group(0x00209111, text(0x00189074, "DT", "20260102030405"))) +
          DicomBuilder::item(positioner("95")));
  return builder;
}

TEST(FunctionalGroups, SharedOnesHoldForEveryFrame) {
  for (int frame : {1, 2}) {
    const auto image = read_dicom(enhanced().bytes(), "x.dcm", frame);
    ASSERT_TRUE(image) << image.error().message;
    const Acquisition& a = image->acquisition;
    ASSERT_TRUE(a.pixel_mm && a.source_detector_mm && a.logarithmic);
    EXPECT_EQ(*a.pixel_mm, Eigen::Vector2d(0.2, 0.3));
    EXPECT_EQ(*a.source_detector_mm, 1020);
    EXPECT_TRUE(*a.logarithmic);
    EXPECT_TRUE(a.flip_hint);
    EXPECT_TRUE(image->warnings.empty());
  }
}

/// A program that did not know the sequence: VR UN, its items in the implicit syntax (PS3.5 6.2.2).
TEST(FunctionalGroups, AreReadWithoutTheirVr) {
  const auto implicit = [](std::uint32_t tag, const std::string& value) {
    return DicomBuilder::element(tag, "", value, false);
  };
  const auto nested = [&](std::uint32_t tag, const std::string& content) {
    return implicit(tag, DicomBuilder::item(content));
  };
  const std::string frames =
      DicomBuilder::item(nested(0x00189405, implicit(0x00181510, "10") + implicit(0x00181511, "-2"))) +
      DicomBuilder::item(nested(0x00189405, implicit(0x00181510, "95") + implicit(0x00181511, "-2")));
  DicomBuilder file = enhanced();
  file.raw(0x52009229, "UN", DicomBuilder::item(nested(0x00289443, implicit(0x00181164, "0.3\\0.2 "))));
  file.raw(0x52009230, "UN", frames);
  const auto image = read_dicom(file.bytes(), "x.dcm", 2);
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->acquisition.primary_angle_deg, 95);
  EXPECT_EQ(image->acquisition.pixel_mm, std::optional(Eigen::Vector2d(0.2, 0.3)));
}

TEST(FunctionalGroups, EachFrameHasItsOwn) {
  const auto first = read_dicom(enhanced().bytes(), "x.dcm", 1),
             second = read_dicom(enhanced().bytes(), "x.dcm", 2);
  EXPECT_EQ(*first->acquisition.primary_angle_deg, 10);
  EXPECT_EQ(*second->acquisition.primary_angle_deg, 95);
  EXPECT_TRUE(first->acquisition.acquired);
  EXPECT_FALSE(second->acquisition.acquired);
}

TEST(FunctionalGroups, FrameOverridesTheSharedValue) {
  DicomBuilder builder = enhanced();
  builder.raw(0x52009230, "SQ",
              DicomBuilder::item(group(0x00189476, text(0x00181110, "DS", "990"))) +
                  DicomBuilder::item(positioner("95")));
  EXPECT_EQ(*read_dicom(builder.bytes(), "x.dcm", 1)->acquisition.source_detector_mm, 990);
  EXPECT_EQ(*read_dicom(builder.bytes(), "x.dcm", 2)->acquisition.source_detector_mm, 1020);
}

TEST(FunctionalGroups, ValueOutOfRangeIsRefused) {
  DicomBuilder builder = enhanced();
  builder.raw(0x52009230, "SQ", DicomBuilder::item(positioner("400")) + DicomBuilder::item(positioner("95")));
  const auto refused = read_dicom(builder.bytes(), "x.dcm", 1);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("Positioner Primary Angle"), std::string::npos);
}

}  // namespace
}  // namespace helicarm::xray
