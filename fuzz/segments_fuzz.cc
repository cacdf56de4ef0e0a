// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/read_volume.h"
#include "helicarm/xray/dicom_builder.h"
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {
namespace {

using xray::DicomBuilder;

std::string text(std::uint32_t tag, const char* vr, std::string value) {
  if (value.size() % 2 != 0) value += ' ';
  return DicomBuilder::element(tag, vr, value, true);
}
std::string word(std::uint32_t tag, int value) {
  return DicomBuilder::element(tag, "US", DicomBuilder::number(value, 2), true);
}
std::string group(std::uint32_t tag, const std::string& content) {
  return DicomBuilder::element(tag, "SQ", DicomBuilder::item(content), true);
}

/// A segmentation of 4 x 3 bits in two frames, whose distance is stated or not.
DicomBuilder segmentation(bool spacing) {
  DicomBuilder builder;
  builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.4").text(0x00620001, "CS", "BINARY");
  builder.word(0x00280010, 3).word(0x00280011, 4).word(0x00280100, 1).text(0x00280008, "IS", "2");
  builder.raw(0x00620002, "SQ", DicomBuilder::item(word(0x00620004, 1) + text(0x00620005, "LO", "femur")));
  const std::string measures =
      (spacing ? text(0x00180088, "DS", "2") : "") + text(0x00280030, "DS", "0.5\\0.5");
  builder.raw(0x52009229, "SQ",
              DicomBuilder::item(group(0x00209116, text(0x00200037, "DS", "1\\0\\0\\0\\1\\0")) +
                                 group(0x00289110, measures)));
  std::string frames;
  for (const char* place : {"0\\0\\4", "0\\0\\8"})
    frames += DicomBuilder::item(group(0x00209113, text(0x00200032, "DS", place)) +
                                 group(0x0062000A, word(0x0062000B, 1)));
  return builder.raw(0x52009230, "SQ", frames).raw(0x7FE00010, "OB", std::string("\x35\xA5\x0F\0", 4));
}

/// The same frames with a byte for each voxel.
std::string shares() {
  return segmentation(true)
      .text(0x00620001, "CS", "FRACTIONAL")
      .text(0x00620010, "CS", "OCCUPANCY")
      .word(0x0062000E, 255)
      .word(0x00280100, 8)
      .raw(0x7FE00010, "OB", std::string(12, '\x7F') + std::string(12, '\x80'))
      .bytes();
}

std::string label_map(int bits) {
  std::string words;
  for (int i = 0; i < 24; ++i) words += DicomBuilder::number(i % 2, bits / 8);
  return segmentation(false)
      .text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.7")
      .text(0x00620001, "CS", "LABELMAP")
      .word(0x00280100, bits)
      .raw(0x7FE00010, "OW", words)
      .bytes();
}

std::string packed() {
  return segmentation(true)
      .text(0x00620001, "CS", "FRACTIONAL")
      .word(0x0062000E, 100)
      .word(0x00280100, 8)
      .syntax("1.2.840.10008.1.2.5")
      .fragments(
          {DicomBuilder::number(1, 4) + DicomBuilder::number(64, 4) + std::string(56, '\0') + "\xF5\x32",
           "ab"})
      .bytes();
}

void run_segment(const std::filesystem::path& file, const volume::SegmentChoice& choice) {
  if (auto segment = volume::read_segment(file, choice); segment && *segment)
    check_volume(**std::move(segment));
}

}  // namespace

void run(std::string_view bytes) {
  run_volume(bytes);
  const auto file = put_file("input", bytes);
  run_segment(file, {1, {}, {}});
  run_segment(file, {{}, "femur", 0.5});
}

std::vector<std::string> seeds() {
  return {segmentation(true).bytes(),
          segmentation(false).bytes(),
          shares(),
          label_map(8),
          label_map(16),
          packed()};
}

}  // namespace helicarm::fuzz
