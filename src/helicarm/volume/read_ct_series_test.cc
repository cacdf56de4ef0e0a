// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::volume {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

class CtSeries : public testing::Test {
 protected:
  CtSeries() { fs::create_directories(folder_); }
  ~CtSeries() override { fs::remove_all(folder_); }

  static xray::DicomBuilder slice(double z, const std::string& series = "2.25.7") {
    xray::DicomBuilder builder;
    builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2").text(0x00080060, "CS", "CT");
    builder.text(0x0020000E, "UI", series).text(0x00200032, "DS", fmt::format("-3\\4\\{}", z));
    builder.text(0x00200037, "DS", "1\\0\\0\\0\\1\\0").text(0x00280030, "DS", "0.5\\0.25");
    builder.text(0x00281052, "DS", "-1000").text(0x00281053, "DS", "2");
    return builder;
  }
  void put(const xray::DicomBuilder& builder) {
    ASSERT_TRUE(write_file(folder_ / fmt::format("{:03}", count_++), builder.bytes()));
  }
  Expected<Volume> read() const { return read_volume(folder_); }

  int count_ = 0;
  fs::path folder_ = fs::temp_directory_path() / fmt::format("helicarm_ct_series_{}", ::getpid());
};

TEST_F(CtSeries, SlicesAreSortedByPositionAndScaled) {
  put(slice(12.5).word(0x00280002, 1));
  put(slice(10));
  put(slice(15));
  ASSERT_TRUE(write_file(folder_ / "notes.txt", "not a slice"));
  const auto volume = read();
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size, Eigen::Vector3i(8, 6, 3));
  EXPECT_EQ(volume->voxels[9], 2 * 109 - 1000);
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(-2.75, 4.5, 12.5));
  EXPECT_TRUE(volume->warnings.empty());
}

TEST_F(CtSeries, MissingOrDuplicateSliceIsRefusedWithFigures) {
  for (const double z : {0.0, 1.0, 2.0, 4.0, 5.0}) put(slice(z));
  const auto gap = read();
  ASSERT_FALSE(gap.has_value());
  EXPECT_EQ(gap.error().reason, Reason::bad_value);
  EXPECT_NEAR(gap.error().figures.at("gap_mm"), 2, 1e-9);
  put(slice(3));
  EXPECT_TRUE(read().has_value());
  put(slice(3));
  EXPECT_EQ(read().error().reason, Reason::bad_value);
}

TEST_F(CtSeries, SlicesBesideTheirStackAreRefusedATiltedStackIsNot) {
  const auto beside = [](int i, double y) {
    return slice(2.5 * i).text(0x00200032, "DS", fmt::format("-3\\{}\\{}", y, 2.5 * i));
  };
  for (int i = 0; i < 6; ++i) put(beside(i, 4 - 0.8 * i));  // a gantry's tilt
  EXPECT_TRUE(read().has_value()) << read().error().message;
  fs::remove_all(folder_);
  for (int i = 0; i < 6; ++i) put(beside(i, i < 3 ? 4 : 5.6));  // two blocks
  ASSERT_FALSE(read().has_value());
  EXPECT_THAT(read().error().message, testing::HasSubstr("misaligned"));
}

TEST_F(CtSeries, SlicesThatDoNotStateTheirRescaleAreNotMixedWithOthers) {
  for (int i = 0; i < 3; ++i) put(slice(i));
  put(slice(3).erase(0x00281052).erase(0x00281053));
  ASSERT_FALSE(read().has_value());
  EXPECT_THAT(read().error().message, testing::HasSubstr("1 of 4 slices"));
  fs::remove_all(folder_);
  for (int i = 0; i < 3; ++i) put(slice(i).erase(0x00281052).erase(0x00281053));
  ASSERT_TRUE(read().has_value());
  EXPECT_THAT(read()->warnings.at(0).message, testing::HasSubstr("taken as Hounsfield units"));
  fs::remove_all(folder_);
  for (int i = 0; i < 3; ++i) put(slice(i).erase(0x00281052));
  EXPECT_EQ(read().error().reason, Reason::bad_value);
}

TEST_F(CtSeries, AMissingThinSliceIsRefused) {
  for (const int i : {0, 1, 2, 4, 5}) put(slice(0.06 * i));
  const auto gap = read();
  ASSERT_FALSE(gap.has_value());
  EXPECT_EQ(gap.error().reason, Reason::bad_value);
  EXPECT_NEAR(gap.error().figures.at("gap_mm"), 0.12, 1e-9);
  put(slice(0.06 * 3));
  EXPECT_TRUE(read().has_value());
}

TEST_F(CtSeries, PositionsRoundedToTheirLastDigitAreEven) {
  for (const char* z : {"0", "0.06", "0.13", "0.19", "0.25", "0.31", "0.38"}) put(slice(std::stod(z)));
  EXPECT_TRUE(read().has_value());
}

TEST_F(CtSeries, SlicesOfTwoPatientsOrFramesAreRefused) {
  put(slice(0).text(0x00200052, "UI", "2.25.1"));
  put(slice(1));  // states no frame of reference
  put(slice(2).text(0x00100020, "LO", "2"));
  EXPECT_EQ(read().error().reason, Reason::patient_mismatch);
  EXPECT_EQ(slice_of_series(folder_).error().reason, Reason::patient_mismatch);
  EXPECT_EQ(read().error().message.find("ANON"), std::string::npos);
  --count_;
  put(slice(2).erase(0x00100020).text(0x00200052, "UI", "2.25.1"));
  EXPECT_TRUE(read().has_value()) << read().error().message;
  --count_;
  put(slice(2).text(0x00200052, "UI", "2.25.2"));
  EXPECT_EQ(read().error().reason, Reason::bad_value);
}

TEST_F(CtSeries, ASliceIsOfTheSeriesThatIsRead) {
  EXPECT_EQ(slice_of_series(folder_).value(), std::nullopt);
  put(slice(7, "2.25.9").text(0x00080008, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER"));
  for (const double z : {0.0, 1.0}) put(slice(z, "2.25.8").text(0x00100020, "LO", "2"));
  for (const double z : {0.0, 1.0, 2.0}) put(slice(z));
  EXPECT_EQ(slice_of_series(folder_).value(), folder_ / "003");
  put(slice(3).text(0x00200052, "UI", "2.25.1"));
  EXPECT_EQ(slice_of_series(folder_).value(), folder_ / "006");
  EXPECT_EQ(slice_of_series(folder_ / "003").value(), std::nullopt);
}

TEST_F(CtSeries, AllSlicesTwiceAreNamed) {
  for (const double z : {0.0, 1.0, 2.0, 0.0, 1.0, 2.0}) put(slice(z));
  const auto twice = read();
  ASSERT_FALSE(twice.has_value());
  EXPECT_EQ(twice.error().reason, Reason::bad_value);
  EXPECT_THAT(twice.error().message, testing::HasSubstr("copies of files"));
}

TEST_F(CtSeries, LargestOfSeveralSeriesIsUsedWithAWarning) {
  for (const double z : {0.0, 1.0, 2.0}) put(slice(z));
  put(slice(0, "2.25.8"));
  put(slice(1, "2.25.8"));
  put(slice(7, "2.25.9").text(0x00080008, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER"));
  const auto volume = read();
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size.z(), 3);
  ASSERT_EQ(volume->warnings.size(), 1u);
  put(slice(2, "2.25.8"));
  EXPECT_EQ(read().error().reason, Reason::name_clash);
}

TEST_F(CtSeries, AFileThatCannotBeReadIsLeftOutAndNamed) {
  for (const double z : {0.0, 1.0, 2.0}) put(slice(z));
  const std::string cut = slice(3).bytes();
  ASSERT_TRUE(write_file(folder_ / "broken", cut.substr(0, cut.size() - 9)));
  const auto volume = read();
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size.z(), 3);
  ASSERT_EQ(volume->warnings.size(), 1u);
  EXPECT_EQ(volume->warnings[0].reason, Reason::truncated);
  EXPECT_NE(volume->warnings[0].message.find("broken"), std::string::npos);
}

TEST_F(CtSeries, AFileThatCannotBeReadIsNamedWhereItsSliceIsMissing) {
  for (const double z : {0.0, 1.0, 3.0, 4.0}) put(slice(z));
  const std::string cut = slice(2).bytes();
  ASSERT_TRUE(write_file(folder_ / "broken", cut.substr(0, cut.size() - 9)));
  const auto volume = read();
  ASSERT_FALSE(volume.has_value());
  EXPECT_EQ(volume.error().reason, Reason::truncated);
  EXPECT_NE(volume.error().message.find("broken"), std::string::npos);
  EXPECT_NE(volume.error().message.find("mm apart"), std::string::npos);
}

TEST_F(CtSeries, ValuesThatAreNotHounsfieldUnitsAreSaid) {
  for (const double z : {0.0, 1.0, 2.0}) put(slice(z).text(0x00281054, "LO", "OD"));
  const auto volume = read();
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  ASSERT_EQ(volume->warnings.size(), 1u);
  EXPECT_EQ(volume->warnings[0].reason, Reason::irregular_file);
}

TEST_F(CtSeries, EnhancedCtIsNamed) {
  put(slice(0).text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2.1"));
  const auto volume = read();
  ASSERT_FALSE(volume.has_value());
  EXPECT_NE(volume.error().message.find("Enhanced CT"), std::string::npos);
}

TEST_F(CtSeries, InvalidSlicesAreRefused) {
  EXPECT_EQ(read().error().reason, Reason::not_an_image);
  put(slice(0));
  EXPECT_EQ(read().error().reason, Reason::bad_size);
  const auto with = [&](const xray::DicomBuilder& odd) {
    put(odd);
    const auto volume = read();
    fs::remove(folder_ / fmt::format("{:03}", --count_));
    return volume ? Reason::usage : volume.error().reason;
  };
  EXPECT_EQ(with(slice(1).text(0x00200037, "DS", "1\\0\\0\\1\\0\\0")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).text(0x00200037, "DS", "0\\1\\0\\1\\0\\0")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).erase(0x00200032)), Reason::bad_value);
  EXPECT_EQ(with(slice(1).text(0x00280030, "DS", "0\\0")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).text(0x00281053, "DS", "nan")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).text(0x00281053, "DS", "0")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).text(0x00281053, "DS", "-2")), Reason::bad_value);
  EXPECT_EQ(with(slice(1).word(0x00280011, 4)), Reason::bad_size);
  EXPECT_EQ(with(slice(1).word(0x00280010, 600)), Reason::truncated);
  xray::DicomBuilder cut = slice(1);
  ASSERT_TRUE(write_file(folder_ / "zzz", cut.bytes().substr(0, cut.bytes().size() - 9)));
  EXPECT_EQ(read().error().reason, Reason::truncated);
}

}  // namespace
}  // namespace helicarm::volume
