// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/volume/label_map.h"
#include "helicarm/volume/volume_files_test.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::HasSubstr;
using xray::DicomBuilder;

std::string text_element(std::uint32_t tag, const char* vr, std::string value) {
  if (value.size() % 2 != 0) value += ' ';
  return DicomBuilder::element(tag, vr, value, true);
}
std::string word_element(std::uint32_t tag, int value) {
  return DicomBuilder::element(tag, "US", DicomBuilder::number(value, 2), true);
}
std::string sequence(std::uint32_t tag, std::initializer_list<std::string> items) {
  std::string all;
  for (const std::string& item : items) all += DicomBuilder::item(item);
  return DicomBuilder::element(tag, "SQ", all, true);
}
std::string items_of(std::initializer_list<std::string> items) {
  std::string all;
  for (const std::string& item : items) all += DicomBuilder::item(item);
  return all;
}

std::string segment(int number, const std::string& label) {
  return word_element(0x00620004, number) + text_element(0x00620005, "LO", label);
}
std::string frame(int number, const std::string& position) {
  return sequence(0x00209113, {text_element(0x00200032, "DS", position)}) +
         sequence(0x0062000A, {word_element(0x0062000B, number)});
}
std::string shared(const std::string& measures = "", const std::string& orientation = "1\\0\\0\\0\\1\\0") {
  return sequence(0x00209116, {text_element(0x00200037, "DS", orientation)}) +
         sequence(0x00289110, {measures + text_element(0x00280030, "DS", "0.5\\0.25")});
}

/// Two segments in slices of 3 x 3 bits: the first at z = 10 and 14, the second at z = 12. Frames follow each
/// other without padding, from the least significant bit on.
DicomBuilder two_segments() {
  DicomBuilder builder;
  builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.4").text(0x00080060, "CS", "SEG");
  builder.word(0x00280010, 3).word(0x00280011, 3).text(0x00280008, "IS", "3");
  builder.word(0x00280100, 1).word(0x00280101, 1).word(0x00280102, 0).text(0x00620001, "CS", "BINARY");
  builder.raw(0x00620002, "SQ", items_of({segment(1, "Femur"), segment(2, "Tibia")}));
  builder.raw(0x52009229, "SQ", items_of({shared()}));
  builder.raw(0x52009230, "SQ",
              items_of({frame(1, "-3\\4\\10"), frame(1, "-3\\4\\14"), frame(2, "-3\\4\\12")}));
  // Bits 0 and 8 of the first frame, 1 of the second (bit 10), 4 and 5 of the third (bits 22 and 23).
  return builder.raw(0x7FE00010, "OB", std::string("\x01\x05\xC0\x00", 4));
}

class Segments : public VolumeFiles {
 protected:
  Expected<Volume> read_seg(const DicomBuilder& builder) const { return read("seg.dcm", builder.bytes()); }
  void expect_refused(const DicomBuilder& builder, Reason reason, const std::string& words) const {
    const auto volume = read_seg(builder);
    ASSERT_FALSE(volume.has_value()) << words;
    EXPECT_EQ(volume.error().reason, reason) << volume.error().message;
    EXPECT_THAT(volume.error().message, HasSubstr(words));
    EXPECT_THAT(volume.error().message, HasSubstr("seg.dcm"));
  }
};

TEST_F(Segments, AreALabelMapOfTheSlicesThatHoldThem) {
  const auto volume = read_seg(two_segments());
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size, Eigen::Vector3i(3, 3, 3));
  EXPECT_THAT(volume->voxels, ElementsAre(1, 0, 0, 0, 0, 0, 0, 0, 1,  //
                                          0, 0, 0, 0, 2, 2, 0, 0, 0,  //
                                          0, 1, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(1, 1, 1), Vector3d(-2.75, 4.5, 12));
  const auto segments = segments_in(folder_ / "seg.dcm");
  ASSERT_TRUE(segments && *segments);
  EXPECT_THAT(**segments, ElementsAre(testing::Pair(1, "Femur"), testing::Pair(2, "Tibia")));
  put("a.nii", Nifti().bytes);
  EXPECT_FALSE(*segments_in(folder_ / "a.nii"));
}

TEST_F(Segments, EmptySlicesAreFilledUpToTheCt) {
  Volume ct{{3, 3, 6}, std::vector<float>(54), Eigen::Affine3d::Identity(), {}};
  ct.patient_from_voxel = Eigen::Translation3d(-3, 4, 18) * Eigen::Scaling(0.25, 0.5, -2.0);
  auto volume = read_seg(two_segments());
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  ASSERT_TRUE(onto_grid(*volume, ct, true));
  EXPECT_EQ(volume->size, ct.size);
  EXPECT_EQ(volume->voxels[0 + 9 * 4], 1);  // z = 10
  EXPECT_EQ(volume->voxels[4 + 9 * 3], 2);
  EXPECT_EQ(volume->voxels[1 + 9 * 2], 1);
  EXPECT_EQ(std::ranges::count(volume->voxels, 0.F), 54 - 5);
  ct.size.z() = 4;  // z = 12 to 18: a part of the segmentation lies outside
  auto beyond = read_seg(two_segments());
  EXPECT_FALSE(onto_grid(*beyond, ct, true));
}

TEST_F(Segments, GapsAreEmptySlicesWhereTheSpacingIsStated) {
  const std::string spacing = text_element(0x00180088, "DS", "2");
  auto apart = two_segments();
  apart.raw(0x52009229, "SQ", items_of({shared(spacing)}));
  apart.raw(0x52009230, "SQ",
            items_of({frame(1, "-3\\4\\10"), frame(1, "-3\\4\\18"), frame(2, "-3\\4\\18")}));
  const auto volume = read_seg(apart);
  ASSERT_TRUE(volume.has_value()) << volume.error().message;
  EXPECT_EQ(volume->size.z(), 5);
  EXPECT_EQ(volume->voxels[4 + 9 * 4], 2);
  auto single = two_segments();
  single.raw(0x52009230, "SQ", items_of({frame(1, "-3\\4\\10")})).text(0x00280008, "IS", "1");
  expect_refused(single, Reason::bad_value, "one slice, without Spacing Between Slices");
  single.raw(0x52009229, "SQ", items_of({shared(text_element(0x00180050, "DS", "3"))}));
  const auto thick = read_seg(single);
  ASSERT_TRUE(thick.has_value()) << thick.error().message;
  EXPECT_EQ(thick->patient_from_voxel.linear().col(2), Vector3d(0, 0, 3));
}

TEST_F(Segments, AThinSliceBetweenTwoPlacesIsRefused) {
  auto thin = two_segments();
  thin.raw(0x52009229, "SQ", items_of({shared(text_element(0x00180088, "DS", "0.06"))}));
  thin.raw(0x52009230, "SQ",
           items_of({frame(1, "-3\\4\\10"), frame(1, "-3\\4\\10.12"), frame(2, "-3\\4\\10.06")}));
  EXPECT_TRUE(read_seg(thin).has_value());
  thin.raw(0x52009230, "SQ",
           items_of({frame(1, "-3\\4\\10"), frame(1, "-3\\4\\10.12"), frame(2, "-3\\4\\10.09")}));
  expect_refused(thin, Reason::bad_value, "no multiple of 0.06 mm");
}

/// Shares in hundredths in slices of 3 x 3 voxels: the first segment in both slices, the second in the first
/// one, where they have a voxel in common.
DicomBuilder shares() {
  auto builder = two_segments();
  builder.text(0x00620001, "CS", "FRACTIONAL").text(0x00620010, "CS", "PROBABILITY");
  builder.word(0x0062000E, 100).word(0x00280100, 8).word(0x00280101, 8).word(0x00280102, 7);
  builder.raw(0x52009230, "SQ",
              items_of({frame(1, "-3\\4\\10"), frame(2, "-3\\4\\10"), frame(1, "-3\\4\\12")}));
  std::string values(28, '\0');
  values[0] = 100, values[1] = 50, values[2] = 49, values[9] = 100, values[18] = 10;
  return builder.raw(0x7FE00010, "OB", values);
}

TEST_F(Segments, AFractionalOneIsCutAtTheStatedShare) {
  put("seg.dcm", shares().bytes());
  const auto of = [&](double threshold) { return **read_segment(folder_ / "seg.dcm", {1, {}, threshold}); };
  EXPECT_THAT(of(0.5).voxels, ElementsAre(1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(of(0.1).voxels, ElementsAre(1, 1, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(read_segment(folder_ / "seg.dcm", {1, {}, {}}).error().message,
              HasSubstr("is FRACTIONAL (PROBABILITY): state by \"mask_threshold\""));
  put("bits.dcm", two_segments().bytes());
  EXPECT_THAT(read_segment(folder_ / "bits.dcm", {1, {}, 0.5}).error().message,
              HasSubstr("is BINARY: it takes no \"mask_threshold\""));
}

TEST_F(Segments, OneOfThemIsReadWhereTheyOverlap) {
  put("seg.dcm", shares().bytes());
  const auto second = read_segment(folder_ / "seg.dcm", {{}, "Tibia", 0.5});
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_THAT((*second)->voxels, ElementsAre(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
}

TEST_F(Segments, AChoiceThatFitsNoneOrSeveralListsThem) {
  put("seg.dcm", two_segments().bytes());
  const auto refusal = [&](const SegmentChoice& choice) {
    return read_segment(folder_ / "seg.dcm", choice).error().message;
  };
  const std::string list = "; its segments: 1 \"Femur\", 2 \"Tibia\"";
  EXPECT_THAT(refusal({}), HasSubstr(list));
  EXPECT_THAT(refusal({3, {}, {}}), HasSubstr("has no segment 3" + list));
  EXPECT_THAT(refusal({{}, "Patella", {}}), HasSubstr("no segment labelled \"Patella\"" + list));
  auto alike = two_segments();
  alike.raw(0x00620002, "SQ", items_of({segment(1, "Bone"), segment(2, "Bone")}));
  put("seg.dcm", alike.bytes());
  EXPECT_THAT(refusal({{}, "Bone", {}}), HasSubstr("several segments labelled \"Bone\""));
}

/// In RLE: a header of 64 bytes, a literal run, and a repetition of 0 up to 9 bytes.
std::string rle(std::initializer_list<int> literal, int bytes = 9) {
  std::string frame = DicomBuilder::number(1, 4) + DicomBuilder::number(64, 4) + std::string(56, '\0');
  frame += char(literal.size() - 1);
  for (const int value : literal) frame += char(value);
  if (const int zeros = bytes - int(literal.size())) frame += {char(1 - zeros), '\0'};
  return frame;
}

/// As one block that is stored as it is (RFC 1951, 3.2.4).
std::string deflated(std::initializer_list<int> bytes) {
  std::string frame = "\x01" + DicomBuilder::number(int(bytes.size()), 2) +
                      DicomBuilder::number(0xFFFF - int(bytes.size()), 2);
  for (const int value : bytes) frame += char(value);
  return frame;
}

TEST_F(Segments, BitsInCompressedFramesAreDecoded) {
  const auto plain = read_seg(two_segments());
  ASSERT_TRUE(plain);
  // Each frame begins with a byte of its own. Bits 0 and 8, 1, 4 and 5.
  const auto packed = [](const char* syntax, std::vector<std::string> frames) {
    return two_segments().syntax(syntax).fragments(frames);
  };
  const char *in_rle = "1.2.840.10008.1.2.5", *in_deflated = "1.2.840.10008.1.2.8.1";
  for (const auto& seg :
       {packed(in_rle, {rle({1, 1}, 2), rle({2, 0}, 2), rle({48, 0}, 2)}),
        packed(in_rle, {rle({1, 0, 0, 0, 0, 0, 0, 0, 255}), rle({0, 1}), rle({0, 0, 0, 0, 1, 1})}),
        packed(in_deflated, {deflated({1, 1}), deflated({2, 0, 0}), deflated({48, 0})})}) {
    const auto volume = read_seg(seg);
    ASSERT_TRUE(volume) << volume.error().message;
    EXPECT_EQ(volume->voxels, plain->voxels);
  }
  expect_refused(packed(in_rle, {rle({1}, 3), rle({2, 0}, 2), rle({48, 0}, 2)}), Reason::truncated,
                 "frame 1");
  expect_refused(packed(in_deflated, {deflated({1, 1}), deflated({2}), deflated({48, 0})}), Reason::truncated,
                 "1 bytes, must be 2");
  expect_refused(packed("1.2.840.10008.1.2.4.50", {"a", "b", "c"}), Reason::unsupported, "with loss");
}

TEST_F(Segments, SharesInRleAreDecoded) {
  auto packed = shares();
  packed.syntax("1.2.840.10008.1.2.5").fragments({rle({100, 50, 49}), rle({100}), rle({10})});
  put("seg.dcm", packed.bytes());
  const auto first = read_segment(folder_ / "seg.dcm", {1, {}, 0.5});
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_THAT((*first)->voxels, ElementsAre(1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
}

/// A word for each voxel of two slices of 3 x 3: 300 in the corner, 2 in the middle of the second, 0 and 9
/// elsewhere; 9 is padding.
DicomBuilder label_map(int bits = 16) {
  auto builder = two_segments();
  builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.7").text(0x00620001, "CS", "LABELMAP");
  builder.word(0x00280100, bits).word(0x00280101, bits).word(0x00280102, bits - 1).word(0x00280120, 9);
  const int first = bits == 16 ? 300 : 3;
  builder.raw(0x00620002, "SQ",
              items_of({segment(0, "Background"), segment(first, "Femur"), segment(2, "Tibia")}));
  builder.text(0x00280008, "IS", "2");
  builder.raw(0x52009230, "SQ",
              items_of({sequence(0x00209113, {text_element(0x00200032, "DS", "-3\\4\\10")}),
                        sequence(0x00209113, {text_element(0x00200032, "DS", "-3\\4\\12")})}));
  std::vector<int> values(18, 0);
  values[0] = first, values[8] = 9, values[13] = 2;
  std::string words;
  for (const int value : values) words += DicomBuilder::number(value, bits / 8);
  return builder.raw(0x7FE00010, "OW", words);
}

TEST_F(Segments, AreReadFromALabelMap) {
  const auto volume = read_seg(label_map());
  ASSERT_TRUE(volume) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(300, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0));
  EXPECT_EQ(volume->patient_from_voxel * Vector3d(0, 0, 1), Vector3d(-3, 4, 12));
  EXPECT_THAT(**segments_in(folder_ / "seg.dcm"),
              ElementsAre(testing::Pair(2, "Tibia"), testing::Pair(300, "Femur")));
  const auto femur = read_segment(folder_ / "seg.dcm", {{}, "Femur", {}});
  ASSERT_TRUE(femur) << femur.error().message;
  EXPECT_THAT((*femur)->voxels, ElementsAre(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(read_segment(folder_ / "seg.dcm", {2, {}, 0.5}).error().message,
              HasSubstr("is LABELMAP: it takes no \"mask_threshold\""));
}

TEST_F(Segments, OfALabelMapOfBytesToo) {
  const auto volume = read_seg(label_map(8));
  ASSERT_TRUE(volume) << volume.error().message;
  EXPECT_THAT(volume->voxels, ElementsAre(3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0));
}

TEST_F(Segments, ALabelThatIsNotDescribedIsRefused) {
  expect_refused(label_map().word(0x00280120, 0), Reason::bad_value,
                 "frame 1 has a pixel of value 9, which Segment Sequence does not list");
  expect_refused(label_map().word(0x00280100, 1), Reason::unsupported,
                 "Bits Allocated (0028,0100) is 1, must be 8 or 16");
  expect_refused(label_map().raw(0x7FE00010, "OW", std::string(20, '\0')), Reason::truncated,
                 "has 20 bytes, 2 frames of 3 x 3 words need 36");
}

TEST_F(Segments, CompressedLabelsMustBeWithoutLoss) {
  const auto packed = [](const char* syntax, const char* lossy) {
    return label_map(8).syntax(syntax).text(0x00282110, "CS", lossy).fragments({"ab", "cd"});
  };
  const char *jpeg = "1.2.840.10008.1.2.4.50", *jpeg_2000 = "1.2.840.10008.1.2.4.91";
  expect_refused(packed(jpeg, "00"), Reason::unsupported, "is compressed with loss, or may be");
  expect_refused(packed(jpeg_2000, "01"), Reason::unsupported, "is compressed with loss, or may be");
  expect_refused(packed(jpeg_2000, "00"), Reason::bad_value, "frame 1");  // damaged, so it was decoded
}

TEST_F(Segments, WhatIsNotReadIsNamed) {
  expect_refused(two_segments().text(0x00620001, "CS", "FRACTIONAL"), Reason::unsupported,
                 "is FRACTIONAL, which is read as a model's mask");
  expect_refused(two_segments().text(0x00620001, "CS", "SURFACE"), Reason::unsupported,
                 "is \"SURFACE\", must be BINARY, FRACTIONAL or LABELMAP");
  expect_refused(two_segments().word(0x00280100, 8), Reason::unsupported,
                 "Bits Allocated (0028,0100) is 8, must be 1");
  expect_refused(two_segments().erase(0x7FE00010), Reason::bad_value, "Pixel Data (7FE0,0010) is missing");
  expect_refused(two_segments().erase(0x52009230), Reason::bad_value, "(5200,9230) is missing");
  expect_refused(two_segments().raw(0x52009229, "SQ", ""), Reason::bad_value,
                 "frame 1: Plane Orientation Sequence");
  expect_refused(two_segments().text(0x00280008, "IS", "4"), Reason::bad_value,
                 "has 3 items, but there are 4 frames");
  expect_refused(two_segments().raw(0x7FE00010, "OB", std::string(2, '\1')), Reason::truncated,
                 "has 2 bytes, 3 frames of 3 x 3 bits need 4");
  expect_refused(two_segments().word(0x00280010, 65535).word(0x00280011, 65535), Reason::bad_size,
                 "must be 1 to 16384");
  expect_refused(two_segments().raw(0x00620002, "SQ", items_of({segment(1, "Femur")})), Reason::bad_value,
                 "frame 3: shows segment 2, which Segment Sequence does not list");
  expect_refused(two_segments().raw(0x52009229, "SQ", items_of({shared("", "1\\0\\0\\1\\0\\0")})),
                 Reason::bad_value, "perpendicular");
}

TEST_F(Segments, FramesThatDoNotFitAreRefused) {
  const auto with = [](const std::string& second, int number = 2) {
    return two_segments().raw(
        0x52009230, "SQ", items_of({frame(1, "-3\\4\\10"), frame(1, second), frame(number, "-3\\4\\12")}));
  };
  expect_refused(with("-3\\4\\15.5"), Reason::bad_value, "lies 5.5 mm from the first, no multiple of 2 mm");
  expect_refused(with("-2\\4\\14"), Reason::bad_value, "misaligned by");
  expect_refused(with("-3\\4\\99999"), Reason::bad_size, "limit 16384 slices");
  // Both at z = 12, with one voxel in common.
  auto both = with("-3\\4\\12");
  both.raw(0x7FE00010, "OB", std::string("\x01\x20\xC0\x00", 4));
  expect_refused(both, Reason::unsupported, "segments 1 and 2 overlap in slice 2");
}

TEST_F(Segments, AnItemThatEndsBeyondItsSequenceIsRefused) {
  // Without VRs a sequence is not walked with the file.
  for (const std::uint32_t tag : {0xFFFEE000U, 0x00280010U}) {
    auto cut = two_segments().syntax("1.2.840.10008.1.2");
    cut.raw(0x00620002, "SQ", DicomBuilder::tag_bytes(tag) + DicomBuilder::number(1000, 4) + "abcd");
    cut.raw(0x52009229, "SQ", "").raw(0x52009230, "SQ", items_of({"", "", ""}));
    const auto volume = read_seg(cut);
    ASSERT_FALSE(volume.has_value());
    EXPECT_THAT(volume.error().message,
                HasSubstr(tag == 0xFFFEE000U ? "1000 bytes announced" : "an item of a sequence"));
  }
}

TEST_F(Segments, TruncationsAndMutationsNeverCrash) {
  for (const std::string& whole : {two_segments().bytes(), label_map().bytes()})
    for (std::size_t at = 128; at < whole.size(); ++at) {
      std::string other = whole;
      other[at] = static_cast<char>(other[at] ^ 0x15);
      for (const std::string& bytes : {whole.substr(0, at), other})
        guarded([&] { return read_segmentation("seg.dcm", bytes).has_value(); });
    }
}

}  // namespace
}  // namespace helicarm::volume
