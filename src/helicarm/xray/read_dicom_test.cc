// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_dicom.h"

#include <array>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/polarity.h"

namespace helicarm::xray {
namespace {

Expected<XrayImage> read(const DicomBuilder& builder, std::optional<int> frame = {}) {
  return read_dicom(builder.bytes(), "x.dcm", frame);
}

std::string_view reason(const DicomBuilder& builder, std::optional<int> frame = {}) {
  const auto xray_image = read(builder, frame);
  return xray_image ? "ok" : code(xray_image.error().reason);
}

bool warned(const XrayImage& xray_image, Reason reason) {
  return std::ranges::any_of(xray_image.warnings, [&](const Warning& w) { return w.reason == reason; });
}

DicomBuilder sign(DicomBuilder builder, int sign) { return builder.word(0x00281041, sign, "SS"); }

TEST(ReadDicom, ValuesAndTags) {
  const auto xray_image = read(DicomBuilder().text(0x00181510, "DS", "-12.5").text(0x00181511, "DS", "+3"));
  ASSERT_TRUE(xray_image) << xray_image.error().message;
  EXPECT_EQ(xray_image->pixels(0, 0), 100);
  EXPECT_EQ(xray_image->pixels(3, 2), 100 + 2 * 8 + 3);
  EXPECT_EQ(xray_image->lowest, 0);
  EXPECT_EQ(xray_image->highest, 4095);
  const Acquisition& a = xray_image->acquisition;
  EXPECT_EQ(*a.pixel_mm, Eigen::Vector2d(0.2, 0.3));
  EXPECT_EQ(a.source_detector_mm, 1000);
  EXPECT_EQ(a.primary_angle_deg, -12.5);
  EXPECT_EQ(a.secondary_angle_deg, 3);
  EXPECT_FALSE(a.flip_hint);
  EXPECT_FALSE(a.logarithmic.has_value());
  EXPECT_TRUE(xray_image->warnings.empty());
}

TEST(ReadDicom, FlipRotationAndRelationshipAreHints) {
  const auto xray_image = read(DicomBuilder()
                                   .text(0x00187034, "CS", "YES")
                                   .text(0x00187032, "DS", "90")
                                   .text(0x00281040, "CS", "LOG"));
  EXPECT_TRUE(xray_image->acquisition.flip_hint);
  EXPECT_EQ(xray_image->acquisition.rotation_hint_deg, 90);
  EXPECT_EQ(xray_image->acquisition.logarithmic, true);
  EXPECT_EQ(xray_image->pixels(0, 0), 100);
  EXPECT_EQ(reason(DicomBuilder().text(0x00187034, "CS", "MAYBE")), "bad_value");
}

TEST(ReadDicom, ImplicitSyntaxGivesTheSame) {
  const auto plain = read(DicomBuilder());
  const auto implicit = read(DicomBuilder().syntax("1.2.840.10008.1.2"));
  ASSERT_TRUE(implicit) << implicit.error().message;
  EXPECT_EQ(implicit->acquisition.instance_key, plain->acquisition.instance_key);
}

TEST(ReadDicom, SignedValuesAndStrayHighBits) {
  std::vector<std::uint16_t> values(48, 0);
  values[0] = 0x0FFF;  // -1 in twelve bits
  values[1] = 0x0800;
  values[2] = 0xF005;  // an overlay above the stored bits
  const auto xray_image = read(DicomBuilder().word(0x00280103, 1).pixels(values));
  ASSERT_TRUE(xray_image);
  EXPECT_EQ(xray_image->pixels(0, 0), -1);
  EXPECT_EQ(xray_image->pixels(1, 0), -2048);
  EXPECT_EQ(xray_image->pixels(2, 0), 5);
  EXPECT_EQ(xray_image->lowest, -2048);
  EXPECT_EQ(xray_image->highest, 2047);
}

TEST(ReadDicom, ImplausibleSpacingAndDistanceAreRefused) {
  for (const char* spacing : {"0\\0.3", "-0.3\\-0.3", "NaN\\NaN", "1e400\\1e400", "0,30\\0,30", "0.3",
                              "0.2\\0.2\\0.2", "inf\\0.3", "0.3\\", "5\\5", "0.3 0.3"}) {
    const auto xray_image = read(DicomBuilder().text(0x00181164, "DS", spacing));
    ASSERT_FALSE(xray_image) << spacing;
    EXPECT_EQ(xray_image.error().reason, Reason::bad_value);
    EXPECT_NE(xray_image.error().message.find("(0018,1164)"), std::string::npos)
        << xray_image.error().message;
  }
  for (const char* distance : {"1", "1e9", "-1000", "nan"})
    EXPECT_EQ(reason(DicomBuilder().text(0x00181110, "DS", distance)), "bad_value") << distance;
}

TEST(ReadDicom, AbsentSpacingStaysAbsent) {
  const auto xray_image =
      read(DicomBuilder().erase(0x00181164).erase(0x00181110).text(0x00280030, "DS", "0.3\\0.3"));
  ASSERT_TRUE(xray_image);
  EXPECT_FALSE(xray_image->acquisition.pixel_mm);
  EXPECT_FALSE(xray_image->acquisition.source_detector_mm);
  EXPECT_TRUE(warned(*xray_image, Reason::spacing_missing));
}

TEST(ReadDicom, ZeroSpacingAndDistanceAreAbsent) {
  for (const char* zero : {"0", "0.0", "+0.000"}) {
    const auto xray_image = read(
        DicomBuilder().text(0x00181110, "DS", zero).text(0x00181164, "DS", std::string(zero) + "\\" + zero));
    ASSERT_TRUE(xray_image) << xray_image.error().message;
    EXPECT_FALSE(xray_image->acquisition.source_detector_mm);
    EXPECT_FALSE(xray_image->acquisition.pixel_mm);
    EXPECT_TRUE(warned(*xray_image, Reason::spacing_missing));
  }
}

TEST(ReadDicom, AspectRatioThatContradictsTheSpacingIsReported) {
  const auto ratio = [](const char* value) { return DicomBuilder().text(0x00280034, "IS", value); };
  EXPECT_FALSE(warned(*read(ratio("3\\2")), Reason::tag_disagrees));
  EXPECT_FALSE(warned(*read(ratio("")), Reason::tag_disagrees));
  EXPECT_TRUE(warned(*read(ratio("1\\1")), Reason::tag_disagrees));
  EXPECT_TRUE(warned(*read(ratio("4\\3").erase(0x00181164)), Reason::tag_disagrees));
  EXPECT_FALSE(warned(*read(ratio("1\\1").erase(0x00181164)), Reason::tag_disagrees));
}

/// Three frames of a run that starts at -10 and 5 degrees.
DicomBuilder run_of_frames(const char* primary, const char* secondary) {
  return DicomBuilder()
      .text(0x00280008, "IS", "3")
      .pixels(std::vector<std::uint16_t>(144, 7))
      .text(0x00181510, "DS", "-10")
      .text(0x00181511, "DS", "5")
      .text(0x00181520, "DS", primary)
      .text(0x00181521, "DS", secondary);
}

TEST(ReadDicom, IncrementsOfARunAreOffsetsOfItsFrames) {
  const DicomBuilder run = run_of_frames("0\\50\\100", "0\\-1\\2.5");
  const std::array primary{-10.0, 40.0, 90.0}, secondary{5.0, 4.0, 7.5};
  for (int frame = 1; frame <= 3; ++frame) {
    const auto image = read(run, frame);
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->acquisition.primary_angle_deg, primary[std::size_t(frame - 1)]);
    EXPECT_EQ(image->acquisition.secondary_angle_deg, secondary[std::size_t(frame - 1)]);
    EXPECT_FALSE(warned(*image, Reason::tag_disagrees));
  }
}

TEST(ReadDicom, OneIncrementIsTheStepFromFrameToFrame) {
  EXPECT_EQ(read(run_of_frames("1.5", "0"), 1)->acquisition.primary_angle_deg, -10);
  EXPECT_EQ(read(run_of_frames("1.5", "0"), 3)->acquisition.primary_angle_deg, -7);
  EXPECT_EQ(read(run_of_frames("1.5", "0"), 3)->acquisition.secondary_angle_deg, 5);
}

TEST(ReadDicom, IncrementsThatContradictTheFramesAreReported) {
  const auto other_count = read(run_of_frames("0\\50", "0"), 2);
  EXPECT_FALSE(other_count->acquisition.primary_angle_deg);
  EXPECT_TRUE(warned(*other_count, Reason::tag_disagrees));
  const auto at_rest = read(run_of_frames("0\\50\\100", "0").text(0x00181500, "CS", "STATIC"), 2);
  EXPECT_EQ(at_rest->acquisition.primary_angle_deg, -10);
  EXPECT_TRUE(warned(*at_rest, Reason::tag_disagrees));
  EXPECT_EQ(reason(run_of_frames("0\\x\\100", "0"), 2), "bad_value");
}

TEST(ReadDicom, ImagerSpacingTakesPrecedenceOverADifferingPixelSpacing) {
  const auto xray_image = read(DicomBuilder().text(0x00280030, "DS", "0.15\\0.15"));
  EXPECT_EQ(xray_image->acquisition.pixel_mm->y(), 0.3);
  EXPECT_TRUE(warned(*xray_image, Reason::tag_disagrees));
}

TEST(ReadDicom, LossyCompressionInTheHistoryIsReported) {
  const auto once_lossy = read(DicomBuilder().text(0x00282110, "CS", "01"));
  ASSERT_TRUE(once_lossy);
  EXPECT_TRUE(warned(*once_lossy, Reason::lossy_image));
  EXPECT_FALSE(warned(*read(DicomBuilder().text(0x00282110, "CS", "00")), Reason::lossy_image));
}

TEST(ReadDicom, SeveralFramesNeedAFrame) {
  std::vector<std::uint16_t> values(96, 1);
  std::fill(values.begin() + 48, values.end(), std::uint16_t{2});
  const auto cine = DicomBuilder().text(0x00280008, "IS", "2").pixels(values);
  const auto unsaid = read(cine);
  ASSERT_FALSE(unsaid);
  EXPECT_EQ(unsaid.error().reason, Reason::bad_value);
  EXPECT_NE(unsaid.error().message.find("2 frames"), std::string::npos);
  EXPECT_EQ(read(cine, 1)->pixels(0, 0), 1);
  EXPECT_EQ(read(cine, 2)->pixels(7, 5), 2);
  EXPECT_NE(read(cine, 1)->acquisition.uid_key, read(cine, 2)->acquisition.uid_key);
  EXPECT_EQ(reason(cine, 3), "bad_value");
  EXPECT_EQ(reason(cine, 0), "bad_value");
  EXPECT_EQ(reason(DicomBuilder(), 1), "ok");
}

TEST(ReadDicom, StorageVariantsGiveTheSameImage) {
  std::vector<std::uint16_t> dark, inverse;
  for (int i = 0; i < 48; ++i) {
    dark.push_back(static_cast<std::uint16_t>(i * 80));
    inverse.push_back(static_cast<std::uint16_t>(4095 - i * 80));
  }
  const auto key = [](const DicomBuilder& builder) { return read(builder)->acquisition.instance_key; };
  const DicomBuilder plain = DicomBuilder().pixels(dark), turned = DicomBuilder().pixels(inverse);
  DicomBuilder monochrome1 = DicomBuilder(turned).text(0x00280004, "CS", "MONOCHROME1");
  const std::string expected = key(plain);
  EXPECT_EQ(key(sign(plain, 1)), expected);
  EXPECT_EQ(key(monochrome1), expected);
  EXPECT_EQ(key(DicomBuilder(turned).text(0x20500020, "CS", "INVERSE")), expected);
  EXPECT_EQ(key(DicomBuilder(monochrome1).text(0x20500020, "CS", "INVERSE")), expected);
  EXPECT_EQ(key(sign(turned, -1)), expected);
  EXPECT_EQ(key(sign(monochrome1, -1)), expected);
  EXPECT_EQ(reason(sign(plain, 2)), "bad_value");
}

/// Balls of value 20 on a noisy background of 200, or inverted.
DicomBuilder balls(bool bright) {
  constexpr int side = 200;
  RandomStream random(7, 1);
  std::string bytes;
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) {
      const int du = u % 50 - 25, dv = v % 50 - 25;
      const int value = (du * du + dv * dv <= 2 ? 20 : 200) + static_cast<int>(random.index(9));
      bytes += static_cast<char>(bright ? 255 - value : value);
    }
  return DicomBuilder()
      .word(0x00280010, side)
      .word(0x00280011, side)
      .word(0x00280100, 8)
      .word(0x00280101, 8)
      .word(0x00280102, 7)
      .raw(0x7FE00010, "OB", bytes);
}

TEST(ReadDicom, ImageDecidesWhereTheTagsDisagree) {
  const std::string expected = read(balls(false))->acquisition.instance_key;
  const auto monochrome1 = [](DicomBuilder b) { return b.text(0x00280004, "CS", "MONOCHROME1"); };
  // Correct for a radiograph: metal stored low and displayed white.
  EXPECT_EQ(read(sign(monochrome1(balls(false)), 1))->acquisition.instance_key, expected);
  // Writer error: inverted values and MONOCHROME1, without the sign.
  const auto careless = read(sign(monochrome1(balls(true)), 1));
  EXPECT_EQ(careless->acquisition.instance_key, expected);
  EXPECT_TRUE(warned(*careless, Reason::tag_disagrees));
  EXPECT_EQ(read(balls(true))->acquisition.instance_key, expected);
  // A consistent sign is applied.
  EXPECT_NE(read(sign(balls(true), 1))->acquisition.instance_key, expected);
}

TEST(ReadDicom, NoiseAndEdgesDoNotDecidePolarity) {
  RandomStream random(3, 1);
  image::Image<float> noise(300, 300), edge(300, 300);
  for (float& p : noise.pixels()) p = static_cast<float>(random.normal());
  for (int v = 0; v < 300; ++v)
    for (int u = 0; u < 300; ++u)
      edge(u, v) = (u - 150) * (u - 150) + (v - 150) * (v - 150) < 120 * 120 ? 1.0f : 0.0f;
  EXPECT_FALSE(metal_looks_bright(noise).has_value());
  EXPECT_FALSE(metal_looks_bright(edge).has_value());
  EXPECT_FALSE(metal_looks_bright(image::Image<float>(2, 2)).has_value());
}

TEST(ReadDicom, KeysDistinguishPatientsStudiesAndImages) {
  const auto one = read(DicomBuilder().text(0x0020000D, "UI", "1.2"))->acquisition;
  const auto other =
      read(DicomBuilder().text(0x00100020, "LO", "2").text(0x0020000D, "UI", "1.3"))->acquisition;
  EXPECT_NE(one.patient_key, other.patient_key);
  EXPECT_NE(one.study_key, other.study_key);
  EXPECT_EQ(one.instance_key, other.instance_key);
  EXPECT_EQ(one.uid_key, other.uid_key);
  EXPECT_NE(one.uid_key, read(DicomBuilder().text(0x00080018, "UI", "2.25.18"))->acquisition.uid_key);
  EXPECT_TRUE(one.frame_of_reference_key.empty());
  EXPECT_EQ(one.patient_key.find("ANON"), std::string::npos);
  EXPECT_TRUE(read(DicomBuilder().erase(0x00100010).erase(0x00100020))->acquisition.patient_key.empty());
}

TEST(ReadDicom, ControlCharactersInThePatientNameAreHarmless) {
  const std::string name = "<script>%n\x1b[31m\xff\xfe" + std::string(10000, 'A');
  const auto xray_image = read(DicomBuilder().text(0x00100010, "PN", name));
  ASSERT_TRUE(xray_image);
  EXPECT_EQ(xray_image->acquisition.patient_key.size(), 32u);
}

}  // namespace
}  // namespace helicarm::xray
