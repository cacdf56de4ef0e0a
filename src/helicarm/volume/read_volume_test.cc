// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/read_volume.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/volume/volume_files_test.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;

class ReadVolume : public VolumeFiles {};

TEST_F(ReadVolume, MetaImageWithMatrixSpacingAndOffset) {
  const auto volume = read("a.mha", meta("TransformMatrix = 0 1 0 -1 0 0 0 0 -1\nOffset = 5 6 7\n"
                                         "ElementSpacing = 2 3 4\nElementType = MET_SHORT\n",
                                         four));
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size, Eigen::Vector3i(2, 1, 2));
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 0, 0), Vector3d(5, 8, 7));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(0, 1, 0), Vector3d(2, 6, 7));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(0, 0, 1), Vector3d(5, 6, 3));
  EXPECT_EQ(volume->centre(), Vector3d(5, 7, 5));
}

TEST_F(ReadVolume, MetaImageOfEveryTypeByteOrderAndCompression) {
  const auto expect = [&](const std::string& lines, const std::string& data) {
    const auto volume = read("a.mha", meta(lines, data));
    ASSERT_TRUE(volume.has_value()) << volume.error().message;
    EXPECT_THAT(volume->voxels, ElementsAre(1, 2, 3, 100)) << lines;
  };
  expect("ElementType = MET_CHAR\n", stored<std::int8_t>({1, 2, 3, 100}));
  expect("ElementType = MET_UCHAR\n", stored<std::uint8_t>({1, 2, 3, 100}));
  expect("ElementType = MET_USHORT\n", stored<std::uint16_t>({1, 2, 3, 100}));
  expect("ElementType = MET_INT\n", stored<std::int32_t>({1, 2, 3, 100}));
  expect("ElementType = MET_UINT\n", stored<std::uint32_t>({1, 2, 3, 100}));
  expect("ElementType = MET_LONG_LONG\n", stored<std::int64_t>({1, 2, 3, 100}));
  expect("ElementType = MET_ULONG_LONG\n", stored<std::uint64_t>({1, 2, 3, 100}));
  expect("ElementType = MET_FLOAT\n", stored<float>({1, 2, 3, 100}));
  expect("ElementType = MET_DOUBLE\nBinaryDataByteOrderMSB = True\n", stored<double>({1, 2, 3, 100}, true));
  expect("ElementType = MET_SHORT\nElementByteOrderMSB = True\n", stored<std::int16_t>({1, 2, 3, 100}, true));
  expect("ElementType = MET_SHORT\nCompressedData = True\n",
         packed(stored<std::int16_t>({1, 2, 3, 100}), false));
  expect("ElementType = MET_SHORT\nHeaderSize = 3\n", "abc" + stored<std::int16_t>({1, 2, 3, 100}));
  expect("ElementType = MET_SHORT\nHeaderSize = -1\n", "abcde" + stored<std::int16_t>({1, 2, 3, 100}));
}

TEST_F(ReadVolume, MetaImageWithSeparateVoxelFile) {
  put("a.raw", four);
  const std::string head =
      "NDims = 3\nDimSize = 2 1 2\nElementType = MET_SHORT\nAnatomicalOrientation = LPI\nElementDataFile = ";
  const auto volume = read("a.mhd", head + "a.raw\n");
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->patient_from_voxel.linear(), Eigen::Matrix3d(Vector3d(-1, -1, 1).asDiagonal()));
  EXPECT_EQ(read("a.mhd", head + "../a.raw\n").error().reason, Reason::path_outside);
  EXPECT_EQ(read("a.mhd", head + "none.raw\n").error().reason, Reason::missing_file);
  EXPECT_EQ(read("a.mhd", head + "LIST\n").error().reason, Reason::unsupported);
}

TEST_F(ReadVolume, InvalidMetaImagesAreRefused) {
  const std::string type = "ElementType = MET_SHORT\n";
  EXPECT_EQ(refusal(meta(type, four.substr(1))), Reason::truncated);
  EXPECT_EQ(refusal("ObjectType = Image\nNDims = 3\n"), Reason::truncated);
  EXPECT_EQ(refusal(meta(type, four, "2 1")), Reason::bad_value);
  EXPECT_EQ(refusal(meta(type, four, "2 0 2")), Reason::bad_size);
  EXPECT_EQ(refusal(meta(type, four, "2 -1 2")), Reason::bad_size);
  EXPECT_EQ(refusal(meta(type, four, "2 1.5 2")), Reason::bad_size);
  EXPECT_EQ(refusal(meta(type, four, "16384 16384 16384")), Reason::bad_size);
  EXPECT_EQ(refusal(meta(type, four, "99999999999999999999 1 2")), Reason::bad_size);
  EXPECT_EQ(refusal(meta(type + "ElementSpacing = 1 nan 1\n", four)), Reason::not_finite);
  EXPECT_EQ(refusal(meta(type + "ElementSpacing = 1 0 1\n", four)), Reason::bad_value);
  EXPECT_EQ(refusal(meta(type + "ElementSpacing = 1 one 1\n", four)), Reason::bad_value);
  EXPECT_EQ(refusal(meta(type + "TransformMatrix = 1 0 0 1 0 0 0 0 1\n", four)), Reason::bad_value);
  EXPECT_EQ(refusal(meta(type + "NDims = 3\n", four)), Reason::bad_value);
  EXPECT_EQ(refusal(meta("ElementType = MET_STRING\n", four)), Reason::unsupported);
  EXPECT_EQ(refusal(meta(type + "ElementNumberOfChannels = 3\n", four)), Reason::unsupported);
  EXPECT_EQ(refusal(meta(type + "HeaderSize = 99\n", four)), Reason::truncated);
  EXPECT_EQ(refusal(meta(type + "CompressedData = True\n", "no deflate at all")), Reason::bad_value);
  EXPECT_EQ(refusal(meta("ElementType = MET_FLOAT\n", stored<float>({1, NAN, 2, 3}))), Reason::not_finite);
  EXPECT_EQ(refusal("hello"), Reason::not_an_image);
  EXPECT_EQ(refusal(""), Reason::not_an_image);
  EXPECT_EQ(read_volume(folder_ / "none.mha").error().reason, Reason::missing_file);
}

TEST_F(ReadVolume, CompressedVoxelsAreBoundedInSize) {
  const std::string bomb = packed(std::string(std::size_t{64} << 20, '\0'), false);
  const std::string head = "ElementType = MET_SHORT\nCompressedData = True\n";
  const auto small = read("a.mha", meta(head, bomb));  // only the required bytes are decompressed
  ASSERT_TRUE(small.has_value());
  EXPECT_EQ(small->voxels.size(), 4u);
  EXPECT_EQ(refusal(meta(head, bomb, "1024 1024 512")), Reason::truncated);
  EXPECT_EQ(refusal(meta(head, bomb.substr(0, bomb.size() / 2), "1024 1024 17")), Reason::truncated);
}

TEST_F(ReadVolume, NrrdInEachSpaceAndEncoding) {
  const std::string place = "space directions: (0,2,0) (3,0,0) (0,0,-4)\nspace origin: (5,6,7)\n";
  const auto lps = read("a.nrrd", nrrd("space: left-posterior-superior\nencoding: raw\n" + place, four));
  ASSERT_TRUE(lps.has_value()) << lps.error().message;
  EXPECT_THAT(lps->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(lps->patient_from_voxel * Vector3d(1, 0, 1), Vector3d(5, 8, 3));
  EXPECT_TRUE(lps->warnings.empty());
  const auto ras = read("a.nrrd", nrrd("space: RAS\nencoding: gzip\n" + place, packed(four, true)));
  ASSERT_TRUE(ras.has_value()) << ras.error().message;
  EXPECT_THAT(ras->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(ras->patient_from_voxel * Vector3d(1, 0, 1), Vector3d(-5, -8, 3));
  const auto text = read("a.nrrd", nrrd("spacings: 1 2 3\nencoding: ascii\nnote:=kept\n", "1 2\n-3 4\n"));
  ASSERT_TRUE(text.has_value()) << text.error().message;
  EXPECT_THAT(text->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(text->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(1, 2, 3));
  ASSERT_EQ(text->warnings.size(), 1u);
  EXPECT_EQ(text->warnings[0].reason, Reason::spacing_missing);
  put("a.raw", "xx" + four);
  const auto beside = read("a.nhdr", nrrd("encoding: raw\nbyte skip: -1\ndata file: a.raw\n", ""));
  ASSERT_TRUE(beside.has_value()) << beside.error().message;
  EXPECT_THAT(beside->voxels, ElementsAre(1, 2, -3, 4));
}

TEST_F(ReadVolume, InvalidNrrdsAreRefused) {
  EXPECT_EQ(refusal(nrrd("encoding: raw\nflavour: sweet\n", four)), Reason::unknown_key);
  EXPECT_EQ(refusal(nrrd("encoding: bzip2\n", four)), Reason::unsupported);
  EXPECT_EQ(refusal(nrrd("encoding: raw\n", four.substr(2))), Reason::truncated);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspace: scanner-xyz\n", four)), Reason::unsupported);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspace directions: none (1,0,0) (0,1,0)\n", four)),
            Reason::bad_value);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspace directions: (1,0,0) (1,0,0) (0,1,0)\n", four)),
            Reason::bad_value);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspacings: 1 nan 1\n", four)), Reason::not_finite);
  EXPECT_EQ(refusal(nrrd("encoding: raw\n", four, "block")), Reason::unsupported);
  EXPECT_EQ(refusal(nrrd("encoding: ascii\n", "1 2 3")), Reason::truncated);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nbyte skip: 99\n", four)), Reason::truncated);
  EXPECT_EQ(refusal(nrrd("encoding: raw\ndata file: /etc/passwd\n", four)), Reason::path_outside);
  EXPECT_EQ(refusal("NRRD0004\ntype: short\ndimension: 3\nsizes: 2 1 2\nendian: little\nencoding: raw"),
            Reason::truncated);
  EXPECT_EQ(refusal("NRRD0004\ntype: short\ndimension: 4\nsizes: 2 1 2 1\n\n"), Reason::unsupported);
}

TEST_F(ReadVolume, NiftiOfEitherByteOrderIsConvertedToLps) {
  for (const bool big : {false, true}) {
    const auto volume = read("a.nii", Nifti(big).set(112, 2.0F).set(116, -1.0F).bytes);
    ASSERT_TRUE(volume.has_value()) << volume.error().message;
    EXPECT_THAT(volume->voxels, ElementsAre(1, 3, -7, 7));
    EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(-11, -22, 33));
  }
  const auto volume = read("a.nii.gz", packed(Nifti().bytes, true));
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
}

TEST_F(ReadVolume, NiftiWithQuaternionAndWithoutOrientation) {
  Nifti nifti;
  nifti.set<std::int16_t>(254, 0).set<std::int16_t>(252, 1);
  nifti.set(76, -1.0F).set(264, static_cast<float>(std::sqrt(0.5))).set(268, 1.0F);  // 90 degrees about z
  const auto volume = read("a.nii", nifti.bytes);
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_LT((volume->patient_from_voxel * Vector3d(1, 1, 1) - Vector3d(1, -1, -3)).norm(), 1e-5);
  const auto bare = read("a.nii", nifti.set<std::int16_t>(252, 0).bytes);
  ASSERT_TRUE(bare.has_value());
  EXPECT_EQ(bare->warnings.size(), 1u);
}

TEST_F(ReadVolume, NiftiWhoseOrientationsDifferInHandednessIsRefused) {
  Nifti both;
  both.set<std::int16_t>(252, 1).set(76, 1.0F);
  EXPECT_TRUE(read("a.nii", both.bytes).has_value());
  both.set(76, -1.0F);
  EXPECT_EQ(refusal(both.bytes), Reason::bad_value);
  EXPECT_TRUE(read("a.nii", both.set<std::int16_t>(252, 0).bytes).has_value());
}

TEST_F(ReadVolume, InvalidNiftisAreRefused) {
  EXPECT_EQ(refusal(Nifti().bytes.substr(0, 357)), Reason::truncated);
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(42, -2).bytes), Reason::bad_size);
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(40, 30000).bytes), Reason::unsupported);
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(40, 4).set<std::int16_t>(48, 7).bytes), Reason::unsupported);
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(70, 128).bytes), Reason::unsupported);
  EXPECT_EQ(refusal(Nifti().set<float>(108, 1e30F).bytes), Reason::bad_value);
  EXPECT_EQ(refusal(Nifti().set<float>(108, NAN).bytes), Reason::not_finite);
  EXPECT_EQ(refusal(Nifti().set<float>(280, NAN).bytes), Reason::not_finite);
  EXPECT_EQ(refusal(Nifti().set<float>(280, 0).bytes), Reason::bad_value);
  EXPECT_EQ(refusal(Nifti().set<float>(112, 3e38F).bytes), Reason::not_finite);
  EXPECT_EQ(refusal(packed(Nifti().bytes.substr(0, 300), true)), Reason::truncated);
  EXPECT_EQ(refusal(packed(Nifti().set<std::int16_t>(42, 10000).set<std::int16_t>(44, 10000).bytes, true)),
            Reason::truncated);
  EXPECT_EQ(refusal(packed("hello", true)), Reason::truncated);
}

TEST_F(ReadVolume, TruncationsAndMutationsNeverCrash) {
  for (const std::string& whole : {meta("ElementType = MET_SHORT\n", four), nrrd("encoding: raw\n", four),
                                   Nifti().bytes, Nifti2().bytes})
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string other = whole;
      other[at] = static_cast<char>(other[at] ^ 0x15);
      for (const std::string& bytes : {whole.substr(0, at), other})
        guarded([&] {
          if (whole.starts_with("NRRD")) return read_nrrd(folder_ / "a", bytes).size.x();
          if (whole.starts_with("Obj")) return read_metaimage(folder_ / "a", bytes).size.x();
          return read_nifti(folder_ / "a", bytes).size.x();
        });
    }
}

TEST(Inflate, SizeBeyondThirtyTwoBitsIsRefused) {
  for (const std::size_t size : {std::size_t{1} << 32, (std::size_t{1} << 32) + 352}) {
    const auto bytes = guarded([&] { return inflate("packed", size, "x"); });
    EXPECT_EQ(bytes.error().reason, Reason::bad_size);
  }
}

}  // namespace
}  // namespace helicarm::volume
