// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/png.h"

#include <gtest/gtest.h>
#include <png.h>
#include <zlib.h>

#include "helicarm/core/random.h"

namespace helicarm::image {
namespace {

template <class T>
Image<T> noise(int width, int height) {
  Image<T> image(width, height);
  RandomStream random(1, 1);
  for (T& pixel : image.pixels()) pixel = static_cast<T>(random.bits());
  return image;
}

std::string_view reason(std::string_view bytes) {
  const auto grey_image = decode_png(bytes, "x.png");
  return grey_image ? "ok" : code(grey_image.error().reason);
}

std::string encoded(std::uint32_t format, int channels) {
  const std::string pixels(static_cast<std::size_t>(16 * channels), 'x');
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = image.height = 4;
  image.format = format;
  image.colormap_entries = 2;
  const std::string indices(16, '\1'), colours(6, 'c');
  const bool palette = format & PNG_FORMAT_FLAG_COLORMAP;
  png_alloc_size_t size = 4096;
  std::string bytes(size, '\0');
  png_image_write_to_memory(&image, bytes.data(), &size, 0, palette ? indices.data() : pixels.data(), 0,
                            colours.data());
  bytes.resize(size);
  return bytes;
}

TEST(Png, GreyRoundTripIsExact) {
  const auto wide = noise<std::uint16_t>(37, 21);
  const auto narrow = noise<std::uint8_t>(37, 21);
  const auto wide_back = decode_png(encode_png(wide), "x.png");
  const auto narrow_back = decode_png(encode_png(narrow), "x.png");
  ASSERT_TRUE(wide_back) << wide_back.error().message;
  EXPECT_EQ(wide_back->bits, 16);
  EXPECT_TRUE(std::ranges::equal(wide_back->pixels.pixels(), wide.pixels()));
  EXPECT_EQ(narrow_back->bits, 8);
  EXPECT_TRUE(std::ranges::equal(narrow_back->pixels.pixels(), narrow.pixels()));
}

TEST(Png, EqualColoursAreGrey) {
  cv::Mat rgb(5, 6, CV_8UC3, cv::Scalar(7, 7, 7));
  ASSERT_TRUE(decode_png(encode_png(rgb), "x.png"));
  EXPECT_EQ(decode_png(encode_png(rgb), "x.png")->pixels(5, 4), 7);
  rgb.at<cv::Vec3b>(4, 5) = {7, 7, 8};
  EXPECT_EQ(reason(encode_png(rgb)), "unsupported");
}

TEST(Png, PaletteAndAlphaAreRefused) {
  EXPECT_EQ(reason(encoded(PNG_FORMAT_RGBA, 4)), "unsupported");
  EXPECT_EQ(reason(encoded(PNG_FORMAT_GA, 2)), "unsupported");
  EXPECT_EQ(reason(encoded(PNG_FORMAT_RGB_COLORMAP, 1)), "unsupported");
}

std::string big_endian(std::size_t value) {
  return {char(value >> 24), char(value >> 16), char(value >> 8), char(value)};
}

/// With a chunk behind the header, or before the end.
std::string with_chunk(std::string png, const std::string& name, const std::string& content,
                       bool at_end = false) {
  const std::string body = name + content;
  const auto sum = crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size()));
  constexpr std::size_t behind_header = 33, end_chunk = 12;
  return png.insert(at_end ? png.size() - end_chunk : behind_header,
                    big_endian(content.size()) + body + big_endian(sum));
}

std::string exif(char orientation) {
  return std::string("MM\0*\0\0\0\x08\0\1\1\x12\0\3\0\0\0\1\0", 19) + orientation + std::string(6, '\0');
}

TEST(Png, OrientationsThatTurnTheImageAreRefused) {
  const std::string png = encode_png(noise<std::uint8_t>(8, 6));
  for (const bool at_end : {false, true}) {
    EXPECT_EQ(reason(with_chunk(png, "eXIf", exif(1), at_end)), "ok");
    for (const char turned : {2, 3, 6, 8})
      EXPECT_EQ(reason(with_chunk(png, "eXIf", exif(turned), at_end)), "unsupported");
  }
}

TEST(Png, OrientationInATextProfileIsRefused) {
  const auto profile = [](char orientation) {
    std::string digits;
    for (const char c : "Exif" + std::string(2, '\0') + exif(orientation))
      digits += fmt::format("{:02x}", static_cast<unsigned char>(c));
    return std::string("Raw profile type exif") + '\0' + "\nexif\n      32\n" + digits + "\n";
  };
  const std::string png = encode_png(noise<std::uint8_t>(8, 6));
  EXPECT_EQ(reason(with_chunk(png, "tEXt", profile(1))), "ok");
  EXPECT_EQ(reason(with_chunk(png, "tEXt", profile(6))), "unsupported");
}

TEST(Png, DensitiesAreThePixelsAspect) {
  const std::string png = encode_png(noise<std::uint8_t>(8, 6));
  const auto aspect = [&](std::size_t across, std::size_t down) {
    return decode_png(with_chunk(png, "pHYs", big_endian(across) + big_endian(down) + '\1'), "x.png")
        ->pixel_aspect;
  };
  EXPECT_EQ(aspect(2835, 2835), 1);
  EXPECT_EQ(aspect(1000, 2000), 0.5);
  EXPECT_EQ(aspect(0, 2000), 1);
}

TEST(Png, EveryTruncationIsRefused) {
  const std::string whole = encode_png(noise<std::uint8_t>(20, 20));
  for (std::size_t size = 8; size < whole.size(); ++size)
    EXPECT_EQ(reason(std::string_view(whole).substr(0, size)), "truncated") << size;
}

TEST(Png, MutationsNeverCrash) {
  const std::string whole = encode_png(noise<std::uint16_t>(20, 20));
  RandomStream random(2, 1);
  for (int trial = 0; trial < 2000; ++trial) {
    std::string bytes = whole;
    bytes[random.index(static_cast<std::uint32_t>(whole.size()))] = static_cast<char>(random.bits());
    const auto grey_image = decode_png(bytes, "x.png");
    if (grey_image) {
      EXPECT_FALSE(grey_image->pixels.empty());
    }
  }
}

TEST(Png, HugeHeaderIsRefusedBeforeItIsAccepted) {
  std::string bytes = encode_png(noise<std::uint8_t>(4, 4));
  bytes.replace(16, 8, std::string("\x7F\xFF\xFF\xFF\x7F\xFF\xFF\xFF", 8));
  EXPECT_NE(reason(bytes), "ok");
}

}  // namespace
}  // namespace helicarm::image
