// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/volume/volume_files_test.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::HasSubstr;

/// What a file declares, twice or with other words, and files that hold more or fewer data than they state.
class DeclaredVolume : public VolumeFiles {
 protected:
  Vector3d second_voxel(const std::string& bytes) const {
    const auto volume = read("a", bytes);
    EXPECT_TRUE(volume.has_value()) << volume.error().message;
    return volume ? volume->patient_from_voxel * Vector3d(1, 1, 1) : Vector3d::Zero();
  }
  /// The only warning.
  Warning warning(const std::string& bytes) const {
    const auto volume = read("a", bytes);
    EXPECT_TRUE(volume.has_value()) << volume.error().message;
    if (!volume) return volume.error();
    EXPECT_EQ(volume->warnings.size(), 1U);
    return volume->warnings.empty() ? Warning{Reason::usage, ""} : volume->warnings[0];
  }
  std::string message(const std::string& bytes) const {
    const auto volume = read("a", bytes);
    EXPECT_FALSE(volume.has_value());
    return volume ? "" : volume.error().message;
  }
};

const std::string directions =
    "space: LPS\nspace directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (4,5,6)\n";

TEST_F(DeclaredVolume, NrrdSpaceUnitsAreConvertedToMillimetres) {
  const auto with = [&](const std::string& unit) {
    return second_voxel(nrrd("encoding: raw\n" + directions + "space units: " + unit + "\n", four));
  };
  EXPECT_EQ(with(R"("mm" "mm" "mm")"), Vector3d(5, 7, 9));
  EXPECT_EQ(with(R"("cm" "cm" "cm")"), Vector3d(50, 70, 90));
  EXPECT_TRUE(with(R"("microns" "Microns" "um")").isApprox(Vector3d(5e-3, 7e-3, 9e-3)));
  EXPECT_EQ(with(R"("" "" "")"), Vector3d(5, 7, 9));
}

TEST_F(DeclaredVolume, NrrdUnitsOfTheAxesAreConvertedToo) {
  EXPECT_EQ(second_voxel(nrrd("encoding: raw\nspacings: 1 2 3\nunits: \"cm\" \"cm\" \"cm\"\n", four)),
            Vector3d(10, 20, 30));
}

TEST_F(DeclaredVolume, NrrdUnitsThatAreMixedUnknownOrDifferAreRefused) {
  EXPECT_THAT(message(nrrd("encoding: raw\n" + directions + "space units: \"mm\" \"mm\" \"cm\"\n", four)),
              HasSubstr("space units"));
  EXPECT_THAT(message(nrrd("encoding: raw\n" + directions + "space units: \"px\" \"px\" \"px\"\n", four)),
              HasSubstr("\"px\""));
  EXPECT_THAT(message(nrrd("encoding: raw\n" + directions +
                               "space units: \"mm\" \"mm\" \"mm\"\nunits: \"cm\" \"cm\" \"cm\"\n",
                           four)),
              HasSubstr("units is"));
}

TEST_F(DeclaredVolume, NrrdSpacingsThatContradictTheDirectionsAreRefused) {
  EXPECT_THAT(message(nrrd("encoding: raw\n" + directions + "spacings: 1 2 4\n", four)),
              HasSubstr("spacings"));
  EXPECT_EQ(second_voxel(nrrd("encoding: raw\n" + directions + "spacings: 1 2 3\n", four)),
            Vector3d(5, 7, 9));
}

TEST_F(DeclaredVolume, NegativeSpacingIsRefused) {
  EXPECT_THAT(message(nrrd("encoding: raw\nspace: LPS\nspacings: 1 1 -1\n", four)),
              HasSubstr("spacings is 1 1 -1, must be positive"));
  EXPECT_EQ(refusal(nrrd("encoding: raw\n" + directions + "spacings: 1 2 -3\n", four)), Reason::bad_value);
  for (const char* key : {"ElementSpacing", "ElementSize"})
    for (const char* matrix : {"", "TransformMatrix = 1 0 0 0 1 0 0 0 1\n"})
      EXPECT_EQ(refusal(meta(fmt::format("ElementType = MET_SHORT\n{}{} = 1 1 -1\n", matrix, key), four)),
                Reason::bad_value);
}

TEST_F(DeclaredVolume, NrrdWithoutTheVoxelsSize) {
  const Warning said = warning(nrrd("encoding: raw\nspace: LPS\nspace origin: (4,5,6)\n", four));
  EXPECT_EQ(said.reason, Reason::spacing_missing);
  EXPECT_THAT(said.message, HasSubstr("spacings is missing: 1 is assumed"));
  EXPECT_EQ(said.figures.at("assumed"), 1);
  EXPECT_TRUE(read("a", nrrd("encoding: raw\n" + directions, four))->warnings.empty());
}

TEST_F(DeclaredVolume, NrrdPlacedByAxisMinsIsRefused) {
  EXPECT_EQ(refusal(nrrd("encoding: raw\naxis mins: 0 0 0\naxis maxs: 1 1 1\n", four)), Reason::unsupported);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspacings: 1 2 3\naxis mins: 10 20 30\n", four)),
            Reason::unsupported);
  EXPECT_EQ(refusal(nrrd("encoding: raw\nspacings: 1 2 3\naxismaxs: 10 20 30\n", four)), Reason::unsupported);
  EXPECT_TRUE(read("a", nrrd("encoding: raw\nspacings: 1 2 3\naxis mins: nan nan nan\n", four)).has_value());
}

TEST_F(DeclaredVolume, NrrdWordsInLettersOfEitherCase) {
  const auto volume = read("a",
                           "NRRD0004\nType: Short\nDIMENSION: 3\nsizes: 2 1 2\nEndian: Little\n"
                           "encoding: GZIP\nspace: ras\nSpace Directions: (1,0,0) (0,2,0) (0,0,3)\n\n" +
                               packed(four, true));
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(-1, -2, 3));
}

TEST_F(DeclaredVolume, NrrdByteSkipOfMinusOneCountsFromTheEndOfTheDecompressedData) {
  const auto volume = read("a", nrrd("encoding: gzip\nspace: LPS\nspacings: 1 1 1\nbyte skip: -1\n",
                                     packed("a header" + four, true)));
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_TRUE(volume->warnings.empty());
  const std::string large(5'000'000, 'x');
  const auto far = read("a", nrrd("encoding: gzip\nbyte skip: -1\n", packed(large + four, true)));
  ASSERT_TRUE(far.has_value()) << far.error().message;
  EXPECT_THAT(far->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_EQ(refusal(nrrd("encoding: gzip\nbyte skip: -1\n", packed("short", true))), Reason::truncated);
}

TEST_F(DeclaredVolume, NrrdSkipsLinesThenBytes) {
  const auto raw = read("a", nrrd("encoding: raw\nline skip: 2\nbyte skip: 3\n", "one\ntwo\nabc" + four));
  ASSERT_TRUE(raw.has_value()) << raw.error().message;
  EXPECT_THAT(raw->voxels, ElementsAre(1, 2, -3, 4));
  const auto gzip = read("a", nrrd("encoding: gzip\nbyte skip: 3\n", packed("abc" + four, true)));
  ASSERT_TRUE(gzip.has_value()) << gzip.error().message;
  EXPECT_THAT(gzip->voxels, ElementsAre(1, 2, -3, 4));
}

TEST_F(DeclaredVolume, SequencesAreNamed) {
  EXPECT_THAT(message("NRRD0004\ntype: short\ndimension: 4\nsizes: 5 2 1 2\n\n"),
              HasSubstr("export one frame"));
  EXPECT_THAT(message(nrrd("encoding: raw\nkinds: list domain domain\n", four)),
              HasSubstr("export one frame"));
  EXPECT_THAT(message(meta("ElementType = MET_SHORT\nSeq_Frame0000_Timestamp = 1\n", four)),
              HasSubstr("a sequence of images"));
  EXPECT_THAT(message(Nifti().set<std::int16_t>(40, 4).set<std::int16_t>(48, 7).bytes),
              HasSubstr("export one of them"));
}

TEST_F(DeclaredVolume, OtherKindsOfFileAreNamed) {
  EXPECT_THAT(message(std::string(128, '\0') + "DICM" + std::string(20, ' ')),
              HasSubstr("folder of its series"));
  EXPECT_THAT(message("solid bone\nfacet normal 0 0 1\n"), HasSubstr("\"surface\""));
  EXPECT_THAT(message(std::string("II*\0", 4) + "rest"), HasSubstr("\"voxel_mm\""));
}

TEST_F(DeclaredVolume, MetaImageDistanceUnitsAreConverted) {
  const std::string place = "ElementType = MET_SHORT\nOffset = 4 5 6\nElementSpacing = 1 2 3\n";
  EXPECT_EQ(second_voxel(meta(place + "DistanceUnits = cm\n", four)), Vector3d(50, 70, 90));
  EXPECT_EQ(second_voxel(meta(place + "DistanceUnits = ?\n", four)), Vector3d(5, 7, 9));
  EXPECT_EQ(refusal(meta(place + "DistanceUnits = furlong\n", four)), Reason::unsupported);
}

TEST_F(DeclaredVolume, MetaImageThatStatesOneThingTwice) {
  const std::string place =
      "ElementType = MET_SHORT\nElementSpacing = 1 1 1\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n";
  const Warning letters = warning(meta(place + "AnatomicalOrientation = LPI\n", four));
  EXPECT_EQ(letters.reason, Reason::irregular_file);
  EXPECT_THAT(letters.message, HasSubstr("RAI"));
  EXPECT_EQ(second_voxel(meta(place + "AnatomicalOrientation = RAI\n", four)), Vector3d(1, 1, 1));
  EXPECT_EQ(refusal(meta(place + "Offset = 1 2 3\nPosition = 1 2 4\n", four)), Reason::bad_value);
  EXPECT_EQ(refusal(meta(place + "BinaryDataByteOrderMSB = True\nElementByteOrderMSB = False\n", four)),
            Reason::bad_value);
}

TEST_F(DeclaredVolume, MetaImageWithoutTheVoxelsSize) {
  const std::string type = "ElementType = MET_SHORT\n";
  EXPECT_EQ(warning(meta(type, four)).reason, Reason::spacing_missing);
  EXPECT_TRUE(read("a", meta(type + "ElementSize = 1 2 3\n", four))->warnings.empty());
}

TEST_F(DeclaredVolume, MetaImageIntensityFunctionIsAppliedAndSaid) {
  const std::string bytes = meta(
      "ElementType = MET_SHORT\nElementSpacing = 1 1 1\nElementToIntensityFunctionSlope = "
      "2\nElementToIntensityFunctionOffset = -1\n",
      four);
  EXPECT_EQ(warning(bytes).reason, Reason::irregular_file);
  EXPECT_THAT(read("a", bytes)->voxels, ElementsAre(1, 3, -7, 7));
}

TEST_F(DeclaredVolume, DataBehindTheVoxelsAreWarnedOf) {
  const std::string type = "ElementType = MET_SHORT\nElementSpacing = 1 1 1\n";
  const std::string lps = "space: LPS\nspacings: 1 1 1\n";
  const auto surplus = [&](const std::string& bytes) {
    const Warning said = warning(bytes);
    EXPECT_EQ(said.reason, Reason::surplus_data) << said.message;
    return said.figures.contains("surplus_bytes") ? said.figures.at("surplus_bytes") : 0;
  };
  EXPECT_EQ(surplus(meta(type, four + four)), 8);
  EXPECT_EQ(surplus(meta(type + "CompressedData = True\n", packed(four + "abc", false))), 3);
  EXPECT_EQ(surplus(nrrd(lps + "encoding: raw\n", four + four)), 8);
  EXPECT_EQ(surplus(nrrd(lps + "encoding: gzip\n", packed(four + four, true))), 8);
  EXPECT_EQ(surplus(nrrd(lps + "encoding: gzip\n", packed(four, true) + "tail")), 4);
  EXPECT_EQ(surplus(Nifti().bytes + four), 8);
  EXPECT_EQ(surplus(packed(Nifti().bytes + four, true)), 8);
  EXPECT_TRUE(read("a", meta(type, four + "\n"))->warnings.empty());
}

TEST_F(DeclaredVolume, MembersOfAGzipFileAreOneStream) {
  const std::string whole = Nifti().bytes;
  std::string members;
  for (const std::size_t from : {0, 100, 352, 355})
    members += packed(whole.substr(from, from == 0 ? 100 : from == 100 ? 252 : from == 352 ? 3 : 99), true);
  const auto volume = read("a.nii.gz", members);
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  EXPECT_TRUE(volume->warnings.empty());
}

TEST_F(DeclaredVolume, DamagedCheckSumIsRefused) {
  std::string bytes = packed(Nifti().bytes, true);
  bytes[bytes.size() - 6] = static_cast<char>(bytes[bytes.size() - 6] ^ 1);
  EXPECT_EQ(refusal(bytes), Reason::bad_value);
}

TEST_F(DeclaredVolume, NiftiPixdimThatContradictsTheSformIsRefused) {
  EXPECT_THAT(message(Nifti().set(80, 1.5F).bytes), HasSubstr("pixdim is 1.5 2 3"));
  EXPECT_EQ(warning(Nifti().set(80, 1.005F).bytes).reason, Reason::irregular_file);
  EXPECT_EQ(warning(Nifti().set(80, 0.F).bytes).reason, Reason::irregular_file);
}

TEST_F(DeclaredVolume, NegativePixdimIsRefusedWithoutSform) {
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(254, 0).set<std::int16_t>(252, 1).set(80, -1.F).bytes),
            Reason::bad_value);
  EXPECT_EQ(refusal(Nifti().set<std::int16_t>(254, 0).set(88, -3.F).bytes), Reason::bad_value);
  EXPECT_EQ(warning(Nifti().set(80, -1.F).bytes).reason, Reason::irregular_file);
}

TEST_F(DeclaredVolume, NiftiFormsThatPlaceTheVolumeDifferently) {
  const auto with = [](int sform, int qform, float x) {
    return Nifti()
        .set<std::int16_t>(254, static_cast<std::int16_t>(sform))
        .set<std::int16_t>(252, static_cast<std::int16_t>(qform))
        .set(268, x)
        .set(272, 20.F)
        .set(276, 30.F)
        .bytes;
  };
  EXPECT_TRUE(read("a", with(4, 1, 10))->warnings.empty());
  EXPECT_EQ(refusal(with(2, 1, 15)), Reason::bad_value);
  EXPECT_EQ(refusal(with(4, 1, 15)), Reason::bad_value);
  EXPECT_THAT(warning(with(1, 1, 15)).message, HasSubstr("5 mm"));
}

TEST_F(DeclaredVolume, NiftiUnitOfLengthIsConvertedOrRefused) {
  EXPECT_TRUE(second_voxel(Nifti()
                               .set<std::uint8_t>(123, 1)
                               .set(80, 0.01F)
                               .set(84, 0.02F)
                               .set(88, 0.03F)
                               .set(280, 0.01F)
                               .set(300, 0.02F)
                               .set(320, 0.03F)
                               .bytes)
                  .isApprox(Vector3d(-10010, -20020, 30030), 1e-6));
  EXPECT_EQ(refusal(Nifti().set<std::uint8_t>(123, 5).bytes), Reason::bad_value);
}

TEST_F(DeclaredVolume, NiftiSlopeThatIsNoNumberIsNoScaling) {
  for (const float slope : {NAN, INFINITY, 0.F}) {
    const auto volume = read("a", Nifti().set(112, slope).set(116, NAN).bytes);
    ASSERT_TRUE(volume.has_value()) << volume.error().message;
    EXPECT_THAT(volume->voxels, ElementsAre(1, 2, -3, 4));
  }
  EXPECT_EQ(refusal(Nifti().set(112, 2.F).set(116, NAN).bytes), Reason::not_finite);
}

}  // namespace
}  // namespace helicarm::volume
