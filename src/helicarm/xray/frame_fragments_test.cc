// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/frame_fragments.h"

#include <gtest/gtest.h>

#include "helicarm/xray/dicom_builder.h"

namespace helicarm::xray {
namespace {

constexpr const char* jpeg = "1.2.840.10008.1.2.4.50";
constexpr const char* jpeg_2000_syntax = "1.2.840.10008.1.2.4.90";
constexpr const char* rle = "1.2.840.10008.1.2.5";

const std::string jpeg_begin = "\xFF\xD8\xFF\xDB";
const std::string codestream_begin = "\xFF\x4F\xFF\x51";
const std::string boxes_begin = std::string("\0\0\0\x0CjP  ", 8);
const std::string rle_begin = DicomBuilder::number(2, 4) + DicomBuilder::number(64, 4) +
                              DicomBuilder::number(70, 4) + std::string(52, '\0') + "segments";

/// First fragments of the frames, e.g. "1 3"; or the code of the refusal.
std::string begins(const char* syntax, const std::vector<std::string>& fragments, int frames,
                   const std::string& table = {}) {
  DicomElements elements;
  elements.transfer_syntax = syntax;
  elements.fragments.push_back(table);
  for (const std::string& fragment : fragments) elements.fragments.emplace_back(fragment);
  const auto found = guarded([&] { return fragments_of_frames(elements, frames); });
  if (!found) return std::string(code(found.error().reason));
  std::string text;
  for (const FrameFragments& frame : found->frames) text += fmt::format("{}-{} ", frame.first, frame.last);
  if (found->images > found->frames.size()) text += "surplus";
  return text;
}

TEST(FrameFragments, OneFragmentEach) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin, jpeg_begin, jpeg_begin}, 3), "1-2 2-3 3-4 ");
  EXPECT_EQ(begins(jpeg, {"damaged", "damaged"}, 2), "1-2 2-3 ");
}

TEST(FrameFragments, OneFrameHasAllFragments) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin, "more", "rest"}, 1), "1-4 ");
  EXPECT_EQ(begins(jpeg, {jpeg_begin, ""}, 1), "1-3 ");
}

TEST(FrameFragments, WithoutATableImagesBeginFrames) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin, "more", jpeg_begin, jpeg_begin, "more", "rest"}, 3), "1-3 3-4 4-7 ");
  EXPECT_EQ(begins(jpeg_2000_syntax, {codestream_begin, "more", codestream_begin, "more"}, 2), "1-3 3-5 ");
  EXPECT_EQ(begins(jpeg_2000_syntax, {boxes_begin, "more", boxes_begin, "more"}, 2), "1-3 3-5 ");
  EXPECT_EQ(begins(rle, {rle_begin, "more", rle_begin, "more"}, 2), "1-3 3-5 ");
}

TEST(FrameFragments, EmptyFragmentsHoldNothing) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin, jpeg_begin, ""}, 2), "1-2 2-4 ");
  EXPECT_EQ(begins(rle, {"", rle_begin, rle_begin}, 2), "2-3 3-4 ");
}

TEST(FrameFragments, ByTheTable) {
  const std::string table = DicomBuilder::number(0, 4) + DicomBuilder::number(8 + 4 + 8 + 4, 4);
  EXPECT_EQ(begins(jpeg, {"none", "none", "none"}, 2, table), "1-3 3-4 ");
}

TEST(FrameFragments, TableThatFitsNoFragmentIsNotUsed) {
  const std::string table = DicomBuilder::number(0, 4) + DicomBuilder::number(13, 4);
  EXPECT_EQ(begins(jpeg, {"none", "none", "none"}, 2, table), "bad_value");
  EXPECT_EQ(begins(jpeg, {jpeg_begin, "more", jpeg_begin}, 2, table), "1-3 3-4 ");
}

TEST(FrameFragments, FewerImagesThanFramesAreTruncated) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin}, 2), "truncated");
  EXPECT_EQ(begins(jpeg, {jpeg_begin, "more", "more"}, 2), "truncated");
  EXPECT_EQ(begins(jpeg, {}, 1), "truncated");
  EXPECT_EQ(begins(jpeg, {"", ""}, 1), "truncated");
}

TEST(FrameFragments, MoreImagesThanFramesAreSurplus) {
  EXPECT_EQ(begins(jpeg, {jpeg_begin, jpeg_begin}, 1), "1-2 surplus");
  EXPECT_EQ(begins(jpeg, {jpeg_begin, "more", jpeg_begin, "more", jpeg_begin}, 2), "1-3 3-5 surplus");
}

}  // namespace
}  // namespace helicarm::xray
