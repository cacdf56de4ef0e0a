// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm {

struct DicomTag {
  std::uint32_t number;  ///< group << 16 | element
  const char* name;
};

struct DicomElement {
  std::uint32_t tag;
  std::array<char, 2> vr;  ///< two blanks in the implicit syntax
  std::string_view value;  ///< lies in the bytes that were walked
};

/// The elements of a DICOM file's outermost level, in ascending order, after those of the meta group. Values
/// are views of the file's bytes, which must outlive this.
struct DicomElements {
  std::string origin;
  std::string transfer_syntax;
  std::vector<DicomElement> elements;
  std::vector<std::string_view> fragments;  ///< of encapsulated Pixel Data; the first is the offset table

  const DicomElement* find(DicomTag tag) const;
  /// Without the padding at both ends; empty when absent.
  std::string_view text(DicomTag tag) const;
  /// Decimal text, parts separated by backslashes; nothing when absent or empty. Throws BadInput (bad_value)
  /// unless there are `count` finite numbers from `low` to `high`.
  std::optional<std::vector<double>> numbers(DicomTag tag, std::size_t count, double low, double high) const;
  /// A 16-bit number of VR `vr` ("US" or "SS"), unsigned; nothing when absent. Throws BadInput on any other
  /// shape.
  std::optional<std::uint16_t> word(DicomTag tag, std::string_view vr) const;

  [[noreturn]] void refuse(Reason reason, DicomTag tag, std::string_view problem) const;
};

/// At most 40 printable characters of a value from a file, for a message.
std::string quote(std::string_view value);

/// Walks the structure of a whole DICOM file in memory without trusting any length in it. Little endian only,
/// at most 64 levels of nesting. Refuses: not_an_image (no preamble), truncated, bad_value (odd or senseless
/// length, unknown VR, element twice or out of order, invalid UID), unsupported (big endian, deflated,
/// unknown transfer syntax). `origin` begins each message.
Expected<DicomElements> walk_dicom(std::string_view bytes, const std::string& origin);

}  // namespace helicarm
