// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/nrrd_sequence.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/image_file.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::xray {
namespace {

/// Three images of 40 x 30 pixels as 3D Slicer writes a sequence of them; of image i the value at (u, v) is
/// 1000 i + 30 v + u.
std::string slicer_header(const std::string& type, const std::string& encoding,
                          const std::string& sizes = "40 30 1 3") {
  return "NRRD0004\n# Complete NRRD file format specification at:\ntype: " + type +
         "\ndimension: 4\nspace: left-posterior-superior\nsizes: " + sizes +
         "\nspace directions: (0.2,0,0) (0,0.2,0) (0,0,1) none\nkinds: domain domain domain list\n"
         "labels: \"\" \"\" \"\" \"time\"\nendian: little\nencoding: " +
         encoding +
         "\nspace origin: (0,0,0)\nDataNodeClassName:=vtkMRMLScalarVolumeNode\naxis 3 index type:=numeric\n"
         "axis 3 index values:=0 0.1 0.2\n\n";
}

std::string values_of(int images = 3) {
  std::string bytes;
  for (int i = 0; i < images; ++i)
    for (int v = 0; v < 30; ++v)
      for (int u = 0; u < 40; ++u) {
        const int value = 1000 * i + 30 * v + u;
        bytes += static_cast<char>(value % 256);
        bytes += static_cast<char>(value / 256);
      }
  return bytes;
}

std::string packed(const std::string& plain) {
  std::string bytes(compressBound(uLong(plain.size())) + 32, '\0');
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(plain.data()));
  stream.avail_in = uInt(plain.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = uInt(bytes.size());
  deflate(&stream, Z_FINISH);
  bytes.resize(bytes.size() - stream.avail_out);
  deflateEnd(&stream);
  return bytes;
}

Reason refusal(const std::string& bytes) {
  return guarded([&] { return unpacked_sequence(bytes, "s.seq.nrrd"); }).error().reason;
}

TEST(NrrdSequence, EachImageIsAFrameOfTheFile) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "s.seq.nrrd";
  for (const bool is_packed : {false, true}) {
    ASSERT_TRUE(write_file(path, slicer_header("unsigned short", is_packed ? "gzip" : "raw") +
                                     (is_packed ? packed(values_of()) : values_of())));
    EXPECT_EQ(*count_frames(path), 3);
    const auto file = ImageFile::open(path);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ((*file)->frames(), 3);
    for (const int frame : {3, 1, 2}) {
      const auto image = (*file)->read("cam1", frame), alone = read_xray_image(path, "cam1", frame);
      ASSERT_TRUE(image && alone) << image.error().message;
      EXPECT_EQ(image->pixels(7, 11), float(1000 * (frame - 1) + 30 * 11 + 7));
      EXPECT_EQ(image->acquisition.instance_key, alone->acquisition.instance_key);
    }
    EXPECT_EQ((*file)->read("cam1", 4).error().reason, Reason::bad_value);
  }
}

TEST(NrrdSequence, AVolumeIsNone) {
  EXPECT_FALSE(is_nrrd_sequence(slicer_header("short", "raw", "40 30 20 3")));
  EXPECT_FALSE(is_nrrd_sequence("NRRD0004\ntype: short\ndimension: 3\nsizes: 40 30 20\nencoding: raw\n\n"));
  EXPECT_FALSE(is_nrrd_sequence("NRRD0004\nsizes: 40 30 1 3"));
}

TEST(NrrdSequence, WhatWouldMoveOrMixPixelsIsRefused) {
  const auto header = [](const std::string& lines, const std::string& encoding = "raw") {
    std::string text = slicer_header("ushort", encoding);
    return text.insert(text.find("encoding"), lines);
  };
  EXPECT_EQ(refusal(header("byte skip: 2000\n", "gzip") + packed(std::string(2000, 'x') + values_of())),
            Reason::unsupported);
  EXPECT_EQ(refusal(header("byteskip: -1\n", "gzip") + packed("x" + values_of())), Reason::unsupported);
  EXPECT_EQ(refusal(header("line skip: 1\n", "gzip") + "x\n" + packed(values_of())), Reason::unsupported);
  EXPECT_EQ(refusal(header("sizes: 30 40 1 3\n") + values_of()), Reason::bad_value);
  std::string no_order = slicer_header("ushort", "raw"), other_order = no_order;
  no_order.erase(no_order.find("endian: little\n"), 15);
  other_order.replace(other_order.find("little"), 6, "huge");
  EXPECT_EQ(refusal(no_order + values_of()), Reason::bad_value);
  EXPECT_EQ(refusal(other_order + values_of()), Reason::bad_value);
  EXPECT_TRUE(guarded([&] { return unpacked_sequence(header("byte skip: 0\n") + values_of(), "s"); }));
}

TEST(NrrdSequence, MembersOfAGzipFileAreOneStream) {
  const std::string values = values_of();
  const std::string members = packed(values.substr(0, 1001)) + packed(values.substr(1001));
  const auto plain =
      guarded([&] { return unpacked_sequence(slicer_header("ushort", "gzip") + members + "\n", "s"); });
  ASSERT_TRUE(plain) << plain.error().message;
  EXPECT_TRUE(plain->ends_with("\n\n" + values));
  EXPECT_EQ(refusal(slicer_header("ushort", "gzip") + members + packed("more")), Reason::surplus_data);
  EXPECT_EQ(refusal(slicer_header("ushort", "gzip") + packed(values + "more")), Reason::surplus_data);
  EXPECT_EQ(refusal(slicer_header("ushort", "gzip") + members + "tail"), Reason::surplus_data);
  std::string damaged = packed(values);
  damaged[damaged.size() - 6] = static_cast<char>(damaged[damaged.size() - 6] ^ 1);
  EXPECT_EQ(refusal(slicer_header("ushort", "gzip") + damaged), Reason::bad_value);
}

TEST(NrrdSequence, WhatIsNotWholeOrNotGreyIsRefused) {
  EXPECT_EQ(refusal(slicer_header("ushort", "raw") + values_of(2)), Reason::truncated);
  EXPECT_EQ(refusal(slicer_header("ushort", "gzip") + packed(values_of(2))), Reason::truncated);
  EXPECT_EQ(refusal(slicer_header("ushort", "raw") + values_of(4)), Reason::surplus_data);
  EXPECT_EQ(refusal(slicer_header("float", "raw") + values_of()), Reason::unsupported);
  EXPECT_EQ(refusal(slicer_header("ushort", "bzip2") + values_of()), Reason::unsupported);
  EXPECT_EQ(refusal(slicer_header("ushort", "raw", "40 99999 1 3") + values_of()), Reason::bad_size);
  std::string negative = values_of(1);
  negative[1] = '\xFF';
  const auto image = guarded(
      [&] { return image_of_sequence(slicer_header("short", "raw", "40 30 1 1") + negative, 0, "s"); });
  EXPECT_EQ(image.error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::xray
