// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/volume/in_memory.h"
#include "helicarm/volume/label_map.h"
#include "helicarm/volume/volume_files_test.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::HasSubstr;

class NiftiFiles : public VolumeFiles {
 protected:
  Failure failure(const std::string& bytes, const std::string& name = "a.nii") const {
    const auto volume = read(name, bytes);
    EXPECT_FALSE(volume.has_value());
    return volume ? Failure{Reason::usage, ""} : volume.error();
  }
  void expect_whole(const std::string& name) const {
    const auto volume = read_volume(folder_ / name);
    ASSERT_TRUE(volume.has_value()) << name << ": " << volume.error().message;
    EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4)) << name;
    EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(-11, -22, 33)) << name;
    EXPECT_TRUE(volume->warnings.empty()) << name;
  }
  /// The header of a pair of the first version.
  static std::string first_header(bool big = false) {
    return Nifti(big).set(108, 0.F).bytes.replace(344, 3, "ni1").substr(0, 352);
  }
};

TEST_F(NiftiFiles, SecondVersionOfEitherByteOrderPlainOrPacked) {
  for (const bool big : {false, true}) {
    put("a.nii", Nifti2(big).bytes);
    expect_whole("a.nii");
    put("a.nii.gz", packed(Nifti2(big).bytes, true));
    expect_whole("a.nii.gz");
    const auto scaled = read("a.nii", Nifti2(big).set(176, 2.0).set(184, -1.0).bytes);
    ASSERT_TRUE(scaled.has_value()) << scaled.error().message;
    EXPECT_THAT(scaled->voxels, ElementsAre(1, 3, -7, 7));
  }
}

TEST_F(NiftiFiles, SecondVersionWithQuaternionAndUnit) {
  Nifti2 nifti;
  nifti.set<std::int32_t>(348, 0).set<std::int32_t>(344, 1).set<std::int32_t>(500, 1);  // metres
  nifti.set(104, -1.0).set(112, 1e-3).set(120, 2e-3).set(128, 3e-3);
  nifti.set(368, std::sqrt(0.5)).set(376, 1e-3);  // 90 degrees about z
  const auto volume = read("a.nii", nifti.bytes);
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_LT((volume->patient_from_voxel * Vector3d(1, 1, 1) - Vector3d(1, -1, -3)).norm(), 1e-9);
}

TEST_F(NiftiFiles, SecondVersionIsBoundedAndItsFieldsAreNamed) {
  const auto big_side = failure(Nifti2().set<std::int64_t>(24, std::int64_t{1} << 40).bytes);
  EXPECT_EQ(big_side.reason, Reason::bad_size);
  EXPECT_THAT(big_side.message, HasSubstr("a.nii: dim"));
  EXPECT_EQ(failure(Nifti2().set<std::int64_t>(24, INT64_MIN).bytes).reason, Reason::bad_size);
  EXPECT_EQ(failure(Nifti2().set<std::int64_t>(16, INT64_MAX).bytes).reason, Reason::unsupported);
  EXPECT_THAT(failure(Nifti2().set<std::int64_t>(16, 4).set<std::int64_t>(48, 7).bytes).message,
              HasSubstr("dim[4] is 7"));
  EXPECT_THAT(failure(Nifti2().set<std::int64_t>(168, 352).bytes).message,
              HasSubstr("vox_offset is 352, must be 540 to 1000000"));
  EXPECT_EQ(failure(Nifti2().set<std::int64_t>(168, INT64_MAX).bytes).reason, Reason::bad_value);
  EXPECT_THAT(failure(Nifti2().set(104 + 16, double(NAN)).bytes).message, HasSubstr("pixdim[2] is nan"));
  EXPECT_THAT(failure(Nifti2().set(432 + 8, double(NAN)).bytes).message, HasSubstr("srow_y[1] is nan"));
  EXPECT_EQ(failure(Nifti2().bytes.substr(0, 539)).reason, Reason::truncated);
  EXPECT_EQ(failure(Nifti2().bytes.substr(0, 551)).reason, Reason::truncated);
  EXPECT_EQ(failure(packed(Nifti2().bytes.substr(0, 500), true)).reason, Reason::truncated);
  EXPECT_THAT(failure(Nifti2().set<std::int32_t>(0, 348).bytes).message,
              HasSubstr("sizeof_hdr is 348, must be 540"));
  EXPECT_THAT(failure(Nifti2().bytes.replace(8, 4, "\n\n\x1a\n")).message, HasSubstr("transfer as text"));
}

TEST_F(NiftiFiles, APairIsReadByEitherOfItsFiles) {
  for (const bool big : {false, true}) {
    put("a.hdr", first_header(big));
    put("a.img", stored<std::int16_t>({1, 2, -3, 4}, big));
    put("b.hdr.gz", packed(Nifti2(big).header(), true));
    put("b.img.gz", packed(stored<std::int16_t>({1, 2, -3, 4}, big), true));
    for (const char* name : {"a.hdr", "a.img", "b.hdr.gz", "b.img.gz"}) expect_whole(name);
  }
  put("C.HDR", Nifti2().set<std::int64_t>(168, 3).header());
  put("C.IMG", four);
  expect_whole("C.HDR");
  put("d.hdr", first_header());
  put("d.img.gz", packed(four, true));
  expect_whole("d.hdr");
  put("e.hdr", Nifti().set(108, 3.F).bytes.replace(344, 3, "ni1").substr(0, 352));
  put("e.img", "abc" + four);
  expect_whole("e.hdr");
}

TEST_F(NiftiFiles, APairWithoutItsOtherFileNamesIt) {
  const Failure header = failure(first_header(), "a.hdr");
  EXPECT_EQ(header.reason, Reason::missing_file);
  EXPECT_THAT(header.message, HasSubstr("a.img or a.img.gz, is missing"));
  const Failure voxels = failure(four, "b.img");
  EXPECT_EQ(voxels.reason, Reason::missing_file);
  EXPECT_THAT(voxels.message, HasSubstr("b.hdr or b.hdr.gz, is missing"));
  put("a.img", four);
  put("a.img.gz", packed(four, true));
  EXPECT_EQ(failure(first_header(), "a.hdr").reason, Reason::name_clash);
  EXPECT_THAT(failure(first_header(), "a").message, HasSubstr("does not end with .hdr"));
}

TEST_F(NiftiFiles, VoxelsOfAPairThatAreCutOrTooManyAreSaidOfTheirFile) {
  put("a.hdr", first_header());
  const Failure cut = failure(four.substr(1), "a.img");
  EXPECT_EQ(cut.reason, Reason::truncated);
  EXPECT_THAT(cut.message, HasSubstr("a.img: 7 bytes"));
  const auto more = read("a.img", four + four);
  ASSERT_TRUE(more.has_value()) << more.error().message;
  ASSERT_EQ(more->warnings.size(), 1U);
  EXPECT_EQ(more->warnings[0].reason, Reason::surplus_data);
}

TEST_F(NiftiFiles, AnAnalyzeHeaderIsRefusedForItsOrientation) {
  std::string analyze = first_header();
  analyze.replace(344, 4, std::string(4, '\0'));
  put("a.img", four);
  for (const Failure& refused : {failure(analyze, "a.hdr"), failure(packed(analyze, true), "b.hdr.gz")}) {
    EXPECT_EQ(refused.reason, Reason::not_an_image);
    EXPECT_THAT(refused.message,
                HasSubstr("ANALYZE 7.5 header, which does not state the patient's orientation"));
  }
  EXPECT_THAT(read_volume(folder_ / "a.img").error().message, HasSubstr("ANALYZE 7.5"));
}

TEST_F(NiftiFiles, ALabelMapOfThePairIsAMask) {
  put("labels.hdr", Nifti2().header());
  auto mask = read("labels.img", stored<std::int16_t>({0, 2, 5, 2}));
  ASSERT_TRUE(mask.has_value()) << mask.error().message;
  EXPECT_FALSE(choose_mask(*mask, std::nullopt, std::nullopt, "labels.img", "mask"));
  ASSERT_TRUE(choose_mask(*mask, 2, std::nullopt, "labels.img", "mask"));
  EXPECT_THAT(mask->voxels, ElementsAre(0, 1, 0, 1));
}

TEST_F(NiftiFiles, InMemoryHoldsItsVoxels) {
  const auto volume = volume_of_nifti(Nifti2().bytes, "image");
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(volume_of_nifti(Nifti2().header(), "image").error().reason, Reason::unsupported);
}

}  // namespace
}  // namespace helicarm::volume
