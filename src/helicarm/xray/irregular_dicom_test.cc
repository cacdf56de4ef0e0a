// SPDX-License-Identifier: Apache-2.0
// Files that break rules of DICOM and that DCMTK reads.
#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

constexpr std::size_t preamble = 132, meta_length = 12;

std::string plain() { return DicomBuilder().bytes(); }

/// The data set alone: behind preamble, meta length and Transfer Syntax UID.
std::string data_set(const DicomBuilder& builder) {
  const std::string file = builder.bytes();
  const auto length = static_cast<unsigned char>(file[preamble + 8]);
  return file.substr(preamble + meta_length + length);
}

/// An element of any value length, without padding.
std::string unpadded(std::uint32_t tag, const char* vr, const std::string& value) {
  return DicomBuilder::element(tag, vr, value, true);
}

void expect_same_with_note(const std::string& file) {
  const auto irregular = read_dicom(file, "x.dcm", {});
  ASSERT_TRUE(irregular) << irregular.error().message;
  const auto expected = read_dicom(plain(), "x.dcm", {});
  EXPECT_EQ(irregular->acquisition.instance_key, expected->acquisition.instance_key);
  EXPECT_EQ(irregular->acquisition.source_detector_mm, 1000);
  EXPECT_EQ(irregular->acquisition.pixel_mm, expected->acquisition.pixel_mm);
  EXPECT_TRUE(std::ranges::any_of(irregular->warnings, [](const Warning& warning) {
    return warning.reason == Reason::irregular_file && warning.message.starts_with("x.dcm: ");
  }));
}

std::string_view reason_of_file(const std::string& file) {
  const auto read = read_dicom(file, "x.dcm", {});
  return read ? "ok" : code(read.error().reason);
}

TEST(IrregularDicom, RegularFileHasNoNote) {
  const auto read = read_dicom(plain(), "x.dcm", {});
  ASSERT_TRUE(read);
  for (const Warning& warning : read->warnings) EXPECT_NE(warning.reason, Reason::irregular_file);
}

TEST(IrregularDicom, WithoutPreamble) {
  expect_same_with_note(plain().substr(preamble));
  expect_same_with_note("DICM" + plain().substr(preamble));
}

TEST(IrregularDicom, DataSetAlone) {
  expect_same_with_note(data_set(DicomBuilder()));
  expect_same_with_note(data_set(DicomBuilder().syntax("1.2.840.10008.1.2")));
}

TEST(IrregularDicom, MetaGroupWithoutItsLength) {
  expect_same_with_note(plain().erase(preamble, meta_length));
}

TEST(IrregularDicom, MetaGroupWithAWrongLength) {
  for (const char wrong : {'\0', '\2', '\xF0'}) {
    std::string file = plain();
    file[preamble + 8] = wrong;
    expect_same_with_note(file);
  }
}

TEST(IrregularDicom, PreambleWithoutAMetaGroup) {
  expect_same_with_note(std::string(128, '\0') + "DICM" + data_set(DicomBuilder()));
}

TEST(IrregularDicom, TransferSyntaxThatTheDataSetContradicts) {
  const std::string implicit = data_set(DicomBuilder().syntax("1.2.840.10008.1.2"));
  const std::string head = plain().substr(0, plain().size() - data_set(DicomBuilder()).size());
  expect_same_with_note(head + implicit);
}

TEST(IrregularDicom, OddLength) {
  const std::string file = plain();
  const std::size_t at = file.find(DicomBuilder::tag_bytes(0x00100010));
  expect_same_with_note(file.substr(0, at) + unpadded(0x00080070, "LO", "ACME Lt") + file.substr(at));
}

TEST(IrregularDicom, ElementsOutOfOrder) {
  expect_same_with_note(DicomBuilder()
                            .erase(0x00181110)
                            .erase(0x00280010)
                            .tail(DicomBuilder::element(0x00280010, "US", DicomBuilder::number(6, 2), true) +
                                  DicomBuilder::element(0x00181110, "DS", "1000", true))
                            .bytes());
}

TEST(IrregularDicom, ElementGivenTwice) {
  const auto twice = [](int rows) {
    return DicomBuilder()
        .tail(DicomBuilder::element(0x00280010, "US", DicomBuilder::number(rows, 2), true))
        .bytes();
  };
  expect_same_with_note(twice(6));
  EXPECT_EQ(reason_of_file(twice(5)), "bad_value");
}

TEST(IrregularDicom, UnknownRepresentationsHaveTheLengthsThatDcmtkGivesThem) {
  const std::string file = plain();
  const std::size_t at = file.find(DicomBuilder::tag_bytes(0x00100010));
  const std::string tag = DicomBuilder::tag_bytes(0x00091001);
  expect_same_with_note(file.substr(0, at) + tag + "??" + DicomBuilder::number(2, 2) + "ab" +
                        file.substr(at));
  expect_same_with_note(file.substr(0, at) + tag + "ZZ" + DicomBuilder::number(0, 2) +
                        DicomBuilder::number(2, 4) + "ab" + file.substr(at));
}

TEST(IrregularDicom, ZerosBehindTheLastElement) { expect_same_with_note(plain() + std::string(512, '\0')); }

TEST(IrregularDicom, OddLengthInAFunctionalGroup) {
  const std::string distance = unpadded(0x00181110, "DS", "1020.25");
  const std::string geometry = DicomBuilder::element(0x00189476, "SQ", DicomBuilder::item(distance), true);
  const auto read =
      read_dicom(DicomBuilder().erase(0x00181110).raw(0x52009229, "SQ", DicomBuilder::item(geometry)).bytes(),
                 "x.dcm", {});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->acquisition.source_detector_mm, 1020.25);
}

TEST(IrregularDicom, HighBitAboveTheStoredBits) {
  std::vector<std::uint16_t> low, high;
  for (int i = 0; i < 48; ++i) {
    low.push_back(static_cast<std::uint16_t>(100 + i));
    high.push_back(static_cast<std::uint16_t>((100 + i) * 16));
  }
  expect_same_with_note(DicomBuilder().word(0x00280102, 15).pixels(low).bytes());
  high[0] = static_cast<std::uint16_t>(100 * 16);
  std::vector<std::uint16_t> bright = high;
  bright[47] = 4095 * 16;
  const auto read = read_dicom(DicomBuilder().word(0x00280102, 15).pixels(bright).bytes(), "x.dcm", {});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->pixels(0, 0), 100);
  EXPECT_EQ(read->pixels(7, 5), 4095);
}

TEST(IrregularDicom, LengthsBeyondTheFileAreRefused) {
  const std::string bare = data_set(DicomBuilder());
  for (std::size_t size = 0; size < bare.size(); size += 3)
    EXPECT_NE(reason_of_file(bare.substr(0, size)), "ok") << size;
  std::string lying = DicomBuilder().raw(0x00091001, "UN", "x").bytes();  // odd
  lying.replace(lying.find("UN") + 4, 4, DicomBuilder::number(0x7FFFFFFF, 4));
  EXPECT_NE(reason_of_file(lying), "ok");
}

TEST(IrregularDicom, DeepNestingIsRefused) {
  std::string nested = unpadded(0x00080070, "LO", "odd");
  for (int i = 0; i < 10000; ++i)
    nested += DicomBuilder::tag_bytes(0x00081140) + "SQ" + DicomBuilder::number(0, 2) +
              DicomBuilder::number(-1, 4) + DicomBuilder::tag_bytes(0xFFFEE000) + DicomBuilder::number(-1, 4);
  EXPECT_EQ(reason_of_file(DicomBuilder().tail(nested).bytes()), "bad_value");
}

TEST(IrregularDicom, NoiseAndMutationsNeverCrash) {
  const std::string bare = data_set(DicomBuilder());
  RandomStream random(5, 1);
  for (int trial = 0; trial < 3000; ++trial) {
    std::string bytes = bare;
    for (std::uint32_t flips = 1 + random.index(3); flips > 0; --flips)
      bytes[8 + random.index(static_cast<std::uint32_t>(bytes.size()) - 8)] =
          static_cast<char>(random.bits());
    const auto read = read_dicom(bytes, "x.dcm", {});
    if (!read) {
      EXPECT_EQ(exit_code(read.error().reason), 2);
    }
  }
}

}  // namespace
}  // namespace helicarm::xray
