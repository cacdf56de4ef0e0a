// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/sidecar.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/image/png.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::xray {
namespace {

/// A DICOM file without pixel size or source distance, as some C-arms write it.
std::string bare_dicom() { return DicomBuilder().erase(0x00181164).erase(0x00181110).bytes(); }

class Sidecar : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& bytes) {
    ASSERT_TRUE(write_file(folder_.path() / name, bytes));
  }
  void write_png(const std::string& name) {
    write(name, image::encode_png(image::Image<std::uint8_t>(8, 6, 100)));
  }
  Expected<XrayImage> read(const std::string& name) {
    return read_xray_image(folder_.path() / name, "AP", {});
  }

  static bool lacks_spacing(const XrayImage& image) {
    return std::ranges::any_of(
        image.warnings, [](const Warning& warning) { return warning.reason == Reason::spacing_missing; });
  }

  TemporaryFolder folder_;
};

TEST_F(Sidecar, StatesWhatADicomFileLacks) {
  write("a.dcm", bare_dicom());
  ASSERT_TRUE(read("a.dcm"));
  EXPECT_TRUE(lacks_spacing(*read("a.dcm")));
  write("a.dcm.json", R"({"pixel_mm": 0.25, "source_detector_mm": 980})");
  const auto image = read("a.dcm");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(*image->acquisition.pixel_mm, Eigen::Vector2d(0.25, 0.25));
  EXPECT_EQ(image->acquisition.source_detector_mm, 980);
  EXPECT_FALSE(lacks_spacing(*image));
}

TEST_F(Sidecar, ShortNameBesideADicomFileIsNone) {
  write("a.dcm", bare_dicom());
  write("a.json", R"({"pixel_mm": 0.25})");
  EXPECT_FALSE(read("a.dcm")->acquisition.pixel_mm);
}

TEST_F(Sidecar, MustAgreeWithTheFile) {
  write("a.dcm", DicomBuilder().text(0x00181164, "DS", "0.3\\0.3").bytes());
  write("a.dcm.json", R"({"pixel_mm": 0.302, "source_detector_mm": 1005})");
  const auto image = read("a.dcm");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->acquisition.pixel_mm->x(), 0.3);
  EXPECT_EQ(image->acquisition.source_detector_mm, 1000);
  for (const char* contradiction : {R"({"pixel_mm": 0.31})", R"({"source_detector_mm": 1011})"}) {
    write("a.dcm.json", contradiction);
    const auto refused = read("a.dcm");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().reason, Reason::bad_value);
    EXPECT_NE(refused.error().message.find("a.dcm.json"), std::string::npos);
  }
}

TEST_F(Sidecar, StatesTheAnglesOfAnImageFile) {
  write_png("a.png");
  write("a.json", R"({"primary_deg": -31.5, "secondary_deg": 12})");
  const auto image = read("a.png");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->acquisition.primary_angle_deg, -31.5);
  EXPECT_EQ(image->acquisition.secondary_angle_deg, 12);
}

TEST_F(Sidecar, AnAngleMustAgreeWithTheFileButForWholeTurns) {
  write("a.dcm", DicomBuilder().text(0x00181510, "DS", "30 ").bytes());
  write("a.dcm.json", R"({"primary_deg": -330.4, "secondary_deg": 0})");
  EXPECT_EQ(read("a.dcm").value().acquisition.primary_angle_deg, 30);
  write("a.dcm.json", R"({"primary_deg": 32, "secondary_deg": 0})");
  const auto refused = read("a.dcm");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("a.dcm.json: \"primary_deg\" is 32"));
}

TEST_F(Sidecar, OneAngleWithoutTheOtherIsRefused) {
  write_png("a.png");
  write("a.json", R"({"primary_deg": 30})");
  const auto refused = read("a.png");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("a.json: \"secondary_deg\": is missing"));
}

TEST_F(Sidecar, OneAngleIsNotThatOfSeveralFrames) {
  write("a.dcm",
        DicomBuilder().text(0x00280008, "IS", "2").pixels(std::vector<std::uint16_t>(2 * 48, 100)).bytes());
  write("a.dcm.json", R"({"primary_deg": 30, "secondary_deg": 0})");
  const auto refused = read_xray_image(folder_.path() / "a.dcm", "AP", 1);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("one angle for the 2 images of a.dcm"));
}

TEST_F(Sidecar, CameraBesideTheImageIsNone) {
  write_png("a.png");
  for (const char* camera : {R"({"format": "helicarm-camera/1", "fx": 5000})",
                             R"({"camera_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]})"}) {
    write("a.json", camera);
    const auto image = read("a.png");
    ASSERT_TRUE(image) << image.error().message;
    ASSERT_TRUE(lacks_spacing(*image));
    EXPECT_NE(image->warnings[0].message.find("a.json beside it is another kind of file"), std::string::npos);
    EXPECT_FALSE(sidecar_of(folder_.path() / "a.png"));
  }
  write("a.png.json", R"({"pixel_mm": 0.2})");
  EXPECT_EQ(read("a.png")->acquisition.pixel_mm->x(), 0.2);
}

TEST_F(Sidecar, TwoOfOneImageAgree) {
  write_png("a.png");
  write("a.png.json", R"({"pixel_mm": 0.2})");
  write("a.json", R"({"pixel_mm": 0.2, "source_detector_mm": 1000})");
  const auto image = read("a.png");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->acquisition.source_detector_mm, 1000);
  write("a.json", R"({"pixel_mm": 0.205, "source_detector_mm": 1000})");
  const auto refused = read("a.png");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message,
              testing::HasSubstr("a.png.json: \"pixel_mm\" is 0.2, a.json states 0.205"));
}

TEST_F(Sidecar, MisspeltKeyIsRefused) {
  write_png("a.png");
  write("a.json", R"({"pixel": 0.2, "source_detector": 1000})");
  EXPECT_EQ(read("a.png").error().reason, Reason::unknown_key);
}

}  // namespace
}  // namespace helicarm::xray
