// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/film.h"

#include <algorithm>
#include <cstdlib>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/image_file.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::xray {
namespace film_test {

constexpr int width = 64, height = 50, count = 40;

/// Grey of a frame that states its number in six bright or dark stripes, which no compression hides.
unsigned char grey(int frame, int u) { return (frame >> (u / 11) & 1) ? 210 : 40; }

int number_in(const image::GreyImage& image) {
  int number = 0;
  for (int bit = 0; bit < 6; ++bit) number |= (image.pixels(11 * bit + 4, height / 2) > 125) << bit;
  return number;
}

class Films : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v ffmpeg >/dev/null 2>&1") != 0) GTEST_SKIP() << "ffmpeg is not installed";
  }

  /// A film of `count` frames of these channels; `colour` is added to the last channel of frame 5.
  std::filesystem::path film(const std::string& name, const std::string& options, int channels = 1,
                             int colour = 0) {
    std::string raw;
    for (int frame = 0; frame < count; ++frame)
      for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u)
          for (int channel = 0; channel < channels; ++channel)
            raw += char(grey(frame, u) + (frame == 5 && channel + 1 == channels ? colour : 0));
    EXPECT_TRUE(write_file(folder_.path() / "raw", raw));
    const auto path = folder_.path() / name;
    const std::string command =
        fmt::format("ffmpeg -v error -nostdin -y -f rawvideo -pix_fmt {} -s {}x{} -r 25 -i '{}' {} '{}'",
                    channels == 1 ? "gray" : "bgr24", width, height, (folder_.path() / "raw").string(),
                    options, path.string());
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return path;
  }

  /// The first bytes of a film.
  std::filesystem::path shortened(const std::filesystem::path& path, double share) {
    const std::string bytes = *read_file(path, 1 << 24);
    const auto cut = folder_.path() / ("cut_" + path.filename().string());
    EXPECT_TRUE(write_file(cut, bytes.substr(0, std::size_t(double(bytes.size()) * share))));
    return cut;
  }

  TemporaryFolder folder_;
};

TEST_F(Films, FrameNumbersAreThoseOfTheFilmInEveryOrder) {
  // AVI does not say so where the order of decoding is not that of showing.
  for (const auto& [name, options] : {std::pair{"film.mp4", "-c:v libx264 -pix_fmt yuv420p -g 250 -bf 3"},
                                      {"film.avi", "-c:v mpeg4 -g 15"}}) {
    const auto read = Film::at(film(name, options));
    ASSERT_EQ(read->frames(), count) << name;
    for (const int index : {39, 3, 3, 17, 16, 38, 39}) ASSERT_EQ(number_in(read->read(index)), index) << name;
    EXPECT_TRUE(read->loss());
    EXPECT_EQ(read->bits(), 8);
  }
}

TEST_F(Films, UnevenTimesNeitherRepeatNorDropFrames) {
  const auto read = Film::at(film(
      "film.mp4", "-c:v libx264 -pix_fmt yuv420p -vf 'setpts=(N+7*floor(N/10))/25/TB' -vsync passthrough"));
  ASSERT_EQ(read->frames(), count);
  for (int index = 0; index < count; ++index) ASSERT_EQ(number_in(read->read(index)), index);
}

TEST_F(Films, LosslessGreyValuesAreThoseStored) {
  for (const auto& [name, options, channels] : {std::tuple{"film.avi", "-c:v rawvideo -pix_fmt bgr24", 3},
                                                {"film.avi", "-c:v rawvideo -pix_fmt gray", 1},
                                                {"film.mkv", "-c:v ffv1", 1}}) {
    const auto read = Film::at(film(name, options, channels));
    ASSERT_EQ(read->frames(), count) << options;
    EXPECT_FALSE(read->loss());
    for (const int index : {7, 39})
      for (int u = 0; u < width; ++u)
        ASSERT_EQ(read->read(index).pixels(u, height - 1), grey(index, u)) << options << name;
  }
}

TEST_F(Films, SixteenBitsAreKept) {
  const auto read = Film::at(film("film.mkv", "-c:v ffv1 -pix_fmt gray16le"));
  EXPECT_EQ(read->bits(), 16);
  EXPECT_EQ(read->read(5).pixels(0, 0), 257 * grey(5, 0));
}

TEST_F(Films, ColourIsRefusedWithItsFrame) {
  for (const char* options : {"-c:v rawvideo -pix_fmt bgr24", "-c:v mjpeg -pix_fmt yuvj444p -q:v 1"}) {
    const auto read = *ImageFile::open(film("film.avi", options, 3, 20));
    EXPECT_TRUE(read->read("cam1", 5));
    const auto refused = read->read("cam1", 6);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().reason, Reason::unsupported);
    EXPECT_NE(refused.error().message.find("frame 6 is a colour image"), std::string::npos);
  }
}

TEST_F(Films, TruncatedFilmsAreRefusedWithTheFrame) {
  for (const auto& [name, options] : {std::pair{"film.avi", "-c:v mjpeg -pix_fmt yuvj420p"},
                                      {"film.mp4", "-c:v libx264 -pix_fmt yuv420p -movflags faststart -bf 2"},
                                      {"film.mkv", "-c:v ffv1"}}) {
    const auto refused = ImageFile::open(shortened(film(name, options), 0.7));
    ASSERT_FALSE(refused) << options;
    EXPECT_EQ(refused.error().reason, Reason::truncated) << refused.error().message;
    EXPECT_GE(refused.error().figures.at("frame"), 1) << refused.error().message;
    EXPECT_LE(refused.error().figures.at("frame"), count);
  }
  const auto headless = ImageFile::open(shortened(film("film.mp4", "-c:v mpeg4"), 0.5));
  ASSERT_FALSE(headless);
  EXPECT_EQ(headless.error().reason, Reason::not_an_image) << headless.error().message;
}

TEST_F(Films, TurnedFilmsAreRefused) {
  const auto turned = folder_.path() / "turned.mov";
  const std::string command =
      fmt::format("ffmpeg -v error -nostdin -i '{}' -c copy -metadata:s:v:0 rotate=90 '{}'",
                  film("film.mov", "-c:v mjpeg -pix_fmt yuvj420p").string(), turned.string());
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto refused = ImageFile::open(turned);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported) << refused.error().message;
}

TEST_F(Films, InterlacedFilmsAreRefused) {
  for (const char* options :
       {"-c:v mpeg4 -flags +ildct+ilme -top 1", "-s 64x64 -c:v libx264 -x264opts interlaced=1 -top 1"}) {
    const auto refused = ImageFile::open(film("film.mp4", options));
    ASSERT_FALSE(refused) << options;
    EXPECT_EQ(refused.error().reason, Reason::unsupported) << refused.error().message;
    EXPECT_NE(refused.error().message.find("interlaced"), std::string::npos) << refused.error().message;
  }
}

TEST_F(Films, ImagesThatChangeTheirSizeAreRefused) {
  const std::string at = folder_.path().string() + "/";
  film("one.avi", "-c:v mjpeg -pix_fmt yuvj420p -f mjpeg");
  film("two.avi", "-c:v mjpeg -pix_fmt yuvj420p -s 80x60 -f mjpeg");
  const std::string command = "cat '" + at + "one.avi' '" + at + "two.avi' > '" + at + "both' && " +
                              "ffmpeg -v error -nostdin -f mjpeg -i '" + at + "both' -c copy '" + at +
                              "changes.avi'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto refused = ImageFile::open(at + "changes.avi");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported) << refused.error().message;
  EXPECT_NE(refused.error().message.find("from 64 x 50 to 80 x 60"), std::string::npos)
      << refused.error().message;
}

TEST_F(Films, AreImageFilesOfSeveralFrames) {
  const auto path = film("film.avi", "-c:v mjpeg -pix_fmt yuvj420p");
  const auto file = *ImageFile::open(path);
  EXPECT_EQ(file->frames(), count);
  EXPECT_EQ(*count_frames(path), count);
  const auto third = file->read("cam1", 3), alone = read_xray_image(path, "cam1", 3);
  ASSERT_TRUE(third && alone);
  EXPECT_EQ(third->acquisition.instance_key, alone->acquisition.instance_key);
  EXPECT_EQ(third->highest, 255);
  EXPECT_EQ(third->pixels(15, 9) > 125, true);
  EXPECT_NE(std::ranges::find(third->warnings, Reason::lossy_image, &Warning::reason), third->warnings.end());
  EXPECT_EQ(read_xray_image(path, "cam1", std::nullopt).error().reason, Reason::bad_value);
  EXPECT_EQ(read_xray_image(path, "cam1", count + 1).error().reason, Reason::bad_value);
}

TEST(FilmWithoutFfmpeg, IsNamedWithItsWayOut) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "film.avi";
  ASSERT_TRUE(write_file(path, std::string("RIFF\x10\0\0\0AVI LIST", 16) + std::string(100, '\0')));
  const std::string before = std::getenv("PATH") ? std::getenv("PATH") : "";
  ::setenv("PATH", folder.path().c_str(), 1);
  const auto refused = read_xray_image(path, "cam1", 1);
  ::setenv("PATH", before.c_str(), 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::not_an_image);
  EXPECT_NE(refused.error().message.find("ffmpeg -i FILE -vsync passthrough frame_%04d.png"),
            std::string::npos);
}

}  // namespace film_test
}  // namespace helicarm::xray
