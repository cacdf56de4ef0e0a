// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/write_dicom.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace {
namespace fs = std::filesystem;

class WriteDicom : public ::testing::Test {
 protected:
  WriteDicom() : folder_(fs::temp_directory_path() / ("helicarm_write_dicom_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~WriteDicom() override { fs::remove_all(folder_); }
  fs::path folder_;
};

DerivedImage grey_image(int bits) {
  DerivedImage image{.pixels = image::Image<std::uint16_t>(33, 21), .bits_stored = bits, .acquisition = {}};
  unsigned value = 0;
  for (std::uint16_t& pixel : image.pixels.pixels())
    pixel = static_cast<std::uint16_t>((value += 77) & ((1u << bits) - 1));
  return image;
}

TEST_F(WriteDicom, RoundTripKeepsImageAndTags) {
  for (int bits : {8, 12, 16})
    for (bool rle : {false, true}) {
      DerivedImage image = grey_image(bits);
      image.rle = rle;
      image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.3);
      image.acquisition.source_detector_mm = 997.25;
      image.acquisition.primary_angle_deg = -1.5;
      image.acquisition.flip_hint = true;
      image.acquisition.logarithmic = true;
      ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
      const auto xray_image = read_xray_image(folder_ / "a.dcm", "AP", {});
      ASSERT_TRUE(xray_image) << xray_image.error().message;
      EXPECT_TRUE(std::ranges::equal(xray_image->pixels.pixels(), image.pixels.pixels()));
      EXPECT_EQ(xray_image->highest, static_cast<float>((1 << bits) - 1));
      const Acquisition& a = xray_image->acquisition;
      EXPECT_EQ(*a.pixel_mm, *image.acquisition.pixel_mm);
      EXPECT_EQ(a.source_detector_mm, 997.25);
      EXPECT_EQ(a.primary_angle_deg, -1.5);
      EXPECT_FALSE(a.secondary_angle_deg.has_value());
      EXPECT_TRUE(a.flip_hint);
      EXPECT_EQ(a.logarithmic, true);
    }
}

TEST_F(WriteDicom, SameUidsGiveTheSameBytes) {
  DerivedImage image = grey_image(12);
  RandomStream random(5, 1);
  for (std::string* uid : {&image.study_uid, &image.series_uid, &image.instance_uid}) *uid = make_uid(random);
  ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
  ASSERT_TRUE(write_dicom(folder_ / "b.dcm", image));
  EXPECT_EQ(*read_file(folder_ / "a.dcm", 1 << 20), *read_file(folder_ / "b.dcm", 1 << 20));
}

TEST_F(WriteDicom, ImageOutsideTheLimitsIsRefused) {
  DerivedImage image = grey_image(12);
  image.pixels(3, 3) = 4096;
  EXPECT_EQ(write_dicom(folder_ / "a.dcm", image).error().reason, Reason::bad_value);
  EXPECT_EQ(write_dicom(folder_ / "a.dcm", DerivedImage{}).error().reason, Reason::bad_size);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(Uid, IsARandomUuidInDecimal) {
  const std::string uid = make_uid();
  EXPECT_TRUE(uid.starts_with("2.25."));
  EXPECT_LE(uid.size(), 44u);
  EXPECT_EQ(uid.find_first_not_of("0123456789."), std::string::npos);
  EXPECT_NE(uid, make_uid());
  RandomStream one(1, 2), same(1, 2), other(2, 2);
  const std::string first = make_uid(one);
  EXPECT_EQ(first, make_uid(same));
  EXPECT_NE(first, make_uid(other));
}

}  // namespace
}  // namespace helicarm::xray
