// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_check.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::xray {
namespace {

using namespace std::literals;

std::string_view reason(const std::string& bytes) {
  const auto outline = check_dicom(bytes, "x.dcm");
  return outline ? "ok" : code(outline.error().reason);
}

std::string_view reason(const DicomBuilder& builder) { return reason(builder.bytes()); }

TEST(DicomCheck, ValidFileIsOutlined) {
  const std::string bytes = DicomBuilder().bytes();
  const auto outline = check_dicom(bytes, "x.dcm");
  ASSERT_TRUE(outline) << outline.error().message;
  EXPECT_EQ(outline->rows, 6);
  EXPECT_EQ(outline->columns, 8);
  EXPECT_EQ(outline->bits_stored, 12);
  EXPECT_EQ(outline->frames, 1);
  EXPECT_EQ(outline->pixel_data.size(), 96u);
}

TEST(DicomCheck, FileThatIsNotDicomIsRefused) {
  EXPECT_EQ(reason(""s), "not_an_image");
  EXPECT_EQ(reason(std::string(128, '\0') + "DICM"), "not_an_image");
  EXPECT_EQ(reason("\x89PNG\r\n\x1a\n" + std::string(500, 'x')), "not_an_image");
  std::string noise(65536, '\0');
  RandomStream random(1, 1);
  for (char& c : noise) c = static_cast<char>(random.bits());
  EXPECT_EQ(reason(noise), "not_an_image");
}

TEST(DicomCheck, EveryTruncationIsRefused) {
  const std::string whole = DicomBuilder().bytes();
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_NE(reason(whole.substr(0, size)), "ok") << size;
  EXPECT_EQ(reason(whole.substr(0, 150)), "truncated");
  EXPECT_EQ(reason(whole.substr(0, whole.size() - 1)), "truncated");
}

TEST(DicomCheck, InvalidLengthsAreRefused) {
  const auto pixels_of_length = [](int length) {
    return DicomBuilder()
        .erase(0x7FE00010)
        .tail(DicomBuilder::tag_bytes(0x7FE00010) + "OW" + DicomBuilder::number(0, 2) +
              DicomBuilder::number(length, 4) + std::string(96, '\0'));
  };
  EXPECT_EQ(reason(pixels_of_length(96)), "ok");
  EXPECT_EQ(reason(pixels_of_length(95)), "truncated");
  EXPECT_EQ(reason(pixels_of_length(-2)), "truncated");
  EXPECT_EQ(reason(pixels_of_length(-1)), "bad_value");
}

std::string nested(int levels, bool delimited) {
  std::string bytes;
  for (int i = 0; i < levels; ++i)
    bytes += DicomBuilder::tag_bytes(0x00081140) + "SQ" + DicomBuilder::number(0, 2) +
             DicomBuilder::number(-1, 4) + DicomBuilder::tag_bytes(0xFFFEE000) + DicomBuilder::number(-1, 4);
  for (int i = 0; delimited && i < levels; ++i)
    bytes += DicomBuilder::tag_bytes(0xFFFEE00D) + DicomBuilder::number(0, 4) +
             DicomBuilder::tag_bytes(0xFFFEE0DD) + DicomBuilder::number(0, 4);
  return bytes;
}

DicomBuilder with_last_element(const std::string& sequence_body) {
  return DicomBuilder().tail(DicomBuilder::tag_bytes(0xFFF10010) + "SQ" + DicomBuilder::number(0, 2) +
                             DicomBuilder::number(static_cast<int>(sequence_body.size()), 4) + sequence_body);
}

TEST(DicomCheck, NestedSequencesAreBounded) {
  EXPECT_EQ(reason(with_last_element(DicomBuilder::item(nested(62, true)))), "ok");
  EXPECT_EQ(reason(with_last_element(DicomBuilder::item(nested(64, true)))), "bad_value");
  EXPECT_EQ(reason(with_last_element(DicomBuilder::item(nested(10000, true)))), "bad_value");
  EXPECT_EQ(reason(with_last_element(DicomBuilder::item(nested(5, false)))), "truncated");
}

TEST(DicomCheck, UndelimitedSequenceAtTheEndOfTheFile) {
  EXPECT_EQ(reason(DicomBuilder().tail(DicomBuilder::tag_bytes(0xFFF10010) + "SQ" +
                                       DicomBuilder::number(0, 2) + DicomBuilder::number(-1, 4))),
            "truncated");
}

TEST(DicomCheck, UnknownSequenceIsWalkedAsImplicit) {
  const std::string body = DicomBuilder::item(DicomBuilder::element(0x00091001, "LO", "ab", false)) +
                           DicomBuilder::tag_bytes(0xFFFEE0DD) + DicomBuilder::number(0, 4);
  EXPECT_EQ(reason(DicomBuilder().tail(DicomBuilder::tag_bytes(0xFFF10010) + "UN" +
                                       DicomBuilder::number(0, 2) + DicomBuilder::number(-1, 4) + body)),
            "ok");
}

TEST(DicomCheck, TransferSyntaxes) {
  for (const char* syntax : {"1.2.840.10008.1.2.4.100", "1.2.3.4.5.6.7"})
    EXPECT_EQ(reason(DicomBuilder().syntax(syntax)), "unsupported") << syntax;
  EXPECT_EQ(reason(DicomBuilder().syntax("")), "ok");  // the elements show it, with a note
  EXPECT_EQ(reason(DicomBuilder().syntax("1.2.840.10008.1.2")), "ok");
  EXPECT_EQ(reason(DicomBuilder().syntax("1.2.840.10008.1.2.4.50")),
            "bad_value");                                              // native pixels in a JPEG syntax
  EXPECT_EQ(reason(DicomBuilder().fragments({"abcd"})), "bad_value");  // and the reverse
}

TEST(DicomCheck, Sizes) {
  EXPECT_EQ(reason(DicomBuilder().word(0x00280010, 0)), "bad_size");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280011, 0)), "bad_size");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280010, 65535).word(0x00280011, 65535)), "bad_size");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280010, 16384).word(0x00280011, 16384)), "bad_size");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280010, 7)), "truncated");
  EXPECT_EQ(reason(DicomBuilder().raw(0x00280010, "UL", DicomBuilder::number(6, 4))), "bad_value");
  EXPECT_EQ(
      reason(DicomBuilder().raw(0x00280010, "UL", DicomBuilder::number(6, 4)).syntax("1.2.840.10008.1.2")),
      "bad_value");
  EXPECT_EQ(reason(DicomBuilder().erase(0x00280010)), "bad_value");
}

TEST(DicomCheck, Bits) {
  EXPECT_EQ(reason(DicomBuilder().word(0x00280100, 12)), "bad_value");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280100, 32)), "bad_value");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280101, 20).word(0x00280102, 19)), "bad_value");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280102, 40)), "bad_value");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280101, 10).word(0x00280102, 9)), "ok");
  EXPECT_EQ(reason(DicomBuilder().word(0x00280103, 2)), "bad_value");
}

TEST(DicomCheck, Colours) {
  EXPECT_EQ(reason(DicomBuilder().word(0x00280002, 3)), "unsupported");
  for (const char* photometric : {"RGB", "PALETTE COLOR", "BANANA", ""})
    EXPECT_EQ(reason(DicomBuilder().text(0x00280004, "CS", photometric)), "unsupported") << photometric;
}

TEST(DicomCheck, FrameCounts) {
  for (const char* count : {"2000000000", "-5", "abc", "0", "1.5", "1\\2"})
    EXPECT_EQ(reason(DicomBuilder().text(0x00280008, "IS", count)), "bad_value") << count;
  EXPECT_EQ(reason(DicomBuilder().text(0x00280008, "IS", "30")), "truncated");
  EXPECT_EQ(reason(DicomBuilder().text(0x00280008, "IS", "")), "ok");
}

TEST(DicomCheck, PixelDataBeyondTheFramesAreReported) {
  const auto warnings = [](std::size_t bytes) {
    const std::string file = DicomBuilder().raw(0x7FE00010, "OW", std::string(bytes, 'x')).bytes();
    return check_dicom(file, "x.dcm")->warnings;
  };
  EXPECT_TRUE(warnings(96).empty());
  ASSERT_EQ(warnings(192).size(), 1u);
  EXPECT_EQ(warnings(192)[0].reason, Reason::surplus_data);
  EXPECT_NE(warnings(98)[0].message.find("98 bytes"), std::string::npos);
  const std::string odd = DicomBuilder()
                              .word(0x00280010, 5)
                              .word(0x00280011, 9)
                              .word(0x00280100, 8)
                              .word(0x00280101, 8)
                              .word(0x00280102, 7)
                              .raw(0x7FE00010, "OB", std::string(46, 'x'))
                              .bytes();
  EXPECT_TRUE(check_dicom(odd, "x.dcm")->warnings.empty());
}

TEST(DicomCheck, OtherKindsOfImage) {
  for (const char* sop_class :
       {"1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.4", "1.2.840.10008.5.1.4.1.1.6.1"})
    EXPECT_EQ(reason(DicomBuilder().text(0x00080016, "UI", sop_class)), "unsupported") << sop_class;
  EXPECT_EQ(reason(DicomBuilder().text(0x00080060, "CS", "NM")), "unsupported");
  EXPECT_EQ(reason(DicomBuilder().erase(0x7FE00010)), "bad_value");
}

TEST(DicomCheck, ElementsTwiceAndUnknownRepresentations) {
  EXPECT_EQ(
      reason(DicomBuilder().tail(DicomBuilder::element(0x00280010, "US", DicomBuilder::number(5, 2), true))),
      "bad_value");
  EXPECT_EQ(reason(DicomBuilder().raw(0x00091001, "ZZ", "ab")), "bad_value");
  EXPECT_EQ(reason(DicomBuilder().raw(0x00091001, "UN", std::string(1000, 'x'))), "ok");
  EXPECT_EQ(reason(DicomBuilder().raw(0x00020013, "Q ", "ab")), "bad_value");
}

TEST(DicomCheck, UnknownRepresentationInTheMetaGroup) {
  const std::string sound = DicomBuilder().bytes();
  for (const char* vr : {"ZZ", "Q ", "\xff\xff"}) {
    std::string bytes = sound;
    bytes.replace(148, 2, vr);  // of the Transfer Syntax UID
    EXPECT_EQ(reason(bytes), "bad_value");
    // A long form of 4 GB.
    bytes = sound.substr(0, 144) + DicomBuilder::tag_bytes(0x00020001) + vr + std::string("\0\0", 2) +
            DicomBuilder::number(-2, 4) + sound.substr(144);
    EXPECT_EQ(reason(bytes), "bad_value");
  }
}

TEST(DicomCheck, InvalidUids) {
  for (const auto& uid : {"../../../tmp/x"s, "1.2\0.3"s, std::string(65, '1'), "1.2.x"s, ""s})
    EXPECT_EQ(reason(DicomBuilder().text(0x00080018, "UI", uid)), "bad_value") << uid;
  EXPECT_EQ(reason(DicomBuilder().text(0x0020000D, "UI", "../1")), "bad_value");
}

TEST(DicomCheck, MessagesEscapeFileContent) {
  const std::string bytes =
      DicomBuilder().text(0x00280004, "CS", "<b>\n\x1b[31m" + std::string(500, '%')).bytes();
  const std::string message = check_dicom(bytes, "x.dcm").error().message;
  EXPECT_LT(message.size(), 200u);
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace helicarm::xray
