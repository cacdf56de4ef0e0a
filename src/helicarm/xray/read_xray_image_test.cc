// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_xray_image.h"

#include <gtest/gtest.h>
#include <tiffio.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/parallel.h"
#include "helicarm/image/png.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::xray {
namespace {
namespace fs = std::filesystem;

class ReadXrayImage : public ::testing::Test {
 protected:
  ReadXrayImage()
      : folder_(fs::temp_directory_path() / ("helicarm_read_exposure_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~ReadXrayImage() override { fs::remove_all(folder_); }

  void write(const char* name, const std::string& bytes) { ASSERT_TRUE(write_file(folder_ / name, bytes)); }
  Expected<XrayImage> read(const char* name, std::optional<int> frame = {}) {
    return read_xray_image(folder_ / name, "AP", frame);
  }
  std::string_view reason(const char* name) {
    const auto xray_image = read(name);
    return xray_image ? "ok" : code(xray_image.error().reason);
  }

  fs::path folder_;
};

image::Image<std::uint16_t> ramp() {
  image::Image<std::uint16_t> image(9, 7);
  std::uint16_t value = 0;
  for (std::uint16_t& pixel : image.pixels()) pixel = value = static_cast<std::uint16_t>(value + 1001);
  return image;
}

TEST_F(ReadXrayImage, FormatIsDetectedByContentNotName) {
  write("a.png", DicomBuilder().bytes());
  write("b.dcm", image::encode_png(ramp()));
  write("b.json", R"({"pixel_mm": 0.25, "source_detector_mm": null})");
  EXPECT_EQ(read("a.png")->pixels.width(), 8);
  const auto grey_image = read("b.dcm");
  ASSERT_TRUE(grey_image) << grey_image.error().message;
  EXPECT_EQ(grey_image->name, "AP");
  EXPECT_EQ(grey_image->highest, 65535);
  EXPECT_TRUE(std::ranges::equal(grey_image->pixels.pixels(), ramp().pixels()));
  EXPECT_EQ(*grey_image->acquisition.pixel_mm, Eigen::Vector2d(0.25, 0.25));
  EXPECT_FALSE(grey_image->acquisition.source_detector_mm);
  EXPECT_FALSE(grey_image->acquisition.logarithmic.has_value());
}

TEST_F(ReadXrayImage, FileThatIsNotAnImageIsRefused) {
  write("empty.dcm", "");
  write("text.dcm", "The quick brown fox");
  EXPECT_EQ(reason("empty.dcm"), "not_an_image");
  EXPECT_EQ(reason("text.dcm"), "not_an_image");
  EXPECT_EQ(reason("none.dcm"), "missing_file");
  EXPECT_EQ(read("text.dcm").error().view, "AP");
}

TEST_F(ReadXrayImage, WithoutASidecarAcquisitionParametersAreAbsent) {
  write("a.png", image::encode_png(ramp()));
  const auto bare = read("a.png");
  ASSERT_TRUE(bare) << bare.error().message;
  EXPECT_FALSE(bare->acquisition.pixel_mm);
  EXPECT_FALSE(bare->acquisition.source_detector_mm);
  ASSERT_EQ(bare->warnings.size(), 1u);
  EXPECT_EQ(bare->warnings[0].reason, Reason::spacing_missing);
  EXPECT_NE(bare->warnings[0].message.find("a.json"), std::string::npos);
}

TEST_F(ReadXrayImage, GreyRangeIsThatOfTheSourceNotTheContainer) {
  const auto highest = [&](int first, int factor) {
    image::Image<std::uint16_t> image(64, 64);
    int value = first;
    for (std::uint16_t& pixel : image.pixels()) pixel = static_cast<std::uint16_t>(factor * value--);
    write("a.png", image::encode_png(image));
    return read("a.png")->highest;
  };
  EXPECT_EQ(highest(4095, 1), 4095);
  EXPECT_EQ(highest(4095, 16), 65520);  // 12 bits in the high ones
  EXPECT_EQ(highest(4096, 1), 8191);
  EXPECT_EQ(highest(65535, 1), 65535);
}

TEST_F(ReadXrayImage, SidecarMustBeValid) {
  write("a.png", image::encode_png(ramp()));
  write("a.json", R"({"pixel_mm": -1, "source_detector_mm": null})");
  EXPECT_EQ(reason("a.png"), "bad_value");
  write("a.json", R"({"pixel_mm": NaN})");
  EXPECT_EQ(reason("a.png"), "not_finite");
  write("a.json", R"({"pixel": 1})");
  EXPECT_EQ(reason("a.png"), "unknown_key");
  write("a.png.json", R"({"source_detector_mm": 1000})");
  EXPECT_EQ(reason("a.png"), "unknown_key");  // both count
  write("a.json", R"({"pixel_mm": null})");
  write("a.png.json", R"({"pixel_mm": null, "source_detector_mm": 1000})");
  const auto xray_image = read("a.png");
  ASSERT_TRUE(xray_image) << xray_image.error().message;
  EXPECT_EQ(xray_image->acquisition.source_detector_mm, 1000);
  ASSERT_EQ(xray_image->warnings.size(), 1u);
  EXPECT_EQ(xray_image->warnings[0].reason, Reason::spacing_missing);
  EXPECT_EQ(xray_image->warnings[0].view, "AP");
}

TEST_F(ReadXrayImage, TiffPagesAreFrames) {
  TIFF* tiff = TIFFOpen((folder_ / "a.tif").c_str(), "w");
  for (std::uint8_t page : {1, 2}) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 4);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 1);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    std::uint8_t row[4] = {page, page, page, page};
    TIFFWriteScanline(tiff, row, 0);
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
  write("a.json", R"({"pixel_mm": 0.3, "source_detector_mm": 1000})");
  EXPECT_EQ(reason("a.tif"), "bad_value");
  ASSERT_TRUE(read("a.tif", 2)) << read("a.tif", 2).error().message;
  EXPECT_EQ(read("a.tif", 2)->pixels(3, 0), 2);
  EXPECT_EQ(read("a.tif", 1)->highest, 255);
}

TEST_F(ReadXrayImage, ManyThreadsReadTheSame) {
  DerivedImage image{.pixels = ramp(), .acquisition = {}};
  image.rle = true;
  ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
  write("b.png", image::encode_png(ramp()));
  write("b.json", R"({"pixel_mm": null, "source_detector_mm": null})");
  const std::string expected = read("a.dcm")->acquisition.instance_key;
  std::vector<std::string> keys(64);
  parallel_for(keys.size(), 4, [&](std::size_t i) {
    const auto xray_image = read(i % 2 ? "a.dcm" : "b.png");
    if (xray_image) keys[i] = xray_image->acquisition.instance_key;
    if (!write_dicom(folder_ / (std::to_string(i) + ".dcm"), image)) keys[i] = "not written";
  });
  for (const std::string& key : keys) EXPECT_EQ(key, expected);
}

}  // namespace
}  // namespace helicarm::xray
