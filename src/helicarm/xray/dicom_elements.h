// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

struct DicomTag {
  std::uint32_t number;  ///< group << 16 | element
  const char* name;
};

struct DicomElement {
  std::uint32_t tag;
  std::array<char, 2> vr;  ///< two blanks in the implicit syntax
  std::string_view value;  ///< points into the walked bytes
};

/// Top-level elements of a DICOM file in ascending order, meta group first. Values are views of the file's
/// bytes, which must outlive this object.
struct DicomElements {
  std::string origin;
  std::string transfer_syntax;
  std::vector<DicomElement> elements;
  std::vector<std::string_view> fragments;  ///< of encapsulated Pixel Data; the first is the offset table
  /// What the values point into where the file's bytes had to be inflated or reordered.
  std::shared_ptr<const std::string> converted = {};
  std::string irregular = {};  ///< which rule of DICOM the file breaks, as a message; empty: none

  const DicomElement* find(DicomTag tag) const;
  /// Without padding at either end; empty if absent.
  std::string_view text(DicomTag tag) const;
  /// Decimal text separated by backslashes; nothing if absent or empty. Throws BadInput (bad_value) unless
  /// there are `count` finite numbers from `low` to `high`.
  std::optional<std::vector<double>> numbers(DicomTag tag, std::size_t count, double low, double high) const;
  /// How many values the text has; 0 if absent or empty.
  std::size_t count(DicomTag tag) const;
  /// 16-bit number of VR `vr` ("US" or "SS"; UN is its value without one), unsigned; nothing if absent.
  /// Throws BadInput for any other form.
  std::optional<std::uint16_t> word(DicomTag tag, std::string_view vr) const;

  [[noreturn]] void refuse(Reason reason, DicomTag tag, std::string_view problem) const;
};

/// At most 40 printable characters of a file's value, for a message.
std::string quote(std::string_view value);

/// Whether a file begins as DICOM does: with the preamble, or with the meta group or a data set alone.
bool looks_like_dicom(std::string_view bytes);

/// Walks the structure of a whole DICOM file in memory and checks every length; at most 64 levels of nesting.
/// A file without preamble or meta group, with odd lengths, unknown VRs, elements out of order or given twice
/// alike is read as DCMTK reads it, and `irregular` says what it breaks.
/// Refuses: not_an_image, truncated, bad_value (invalid length, element with two values, invalid UID, damaged
/// deflated data), unsupported (unknown transfer syntax). `origin` begins each message.
Expected<DicomElements> walk_dicom(std::string_view bytes, const std::string& origin);

/// The items of a sequence that `walk_dicom` has walked, each with its elements; none if it is absent. Throws
/// BadInput (bad_value) if an item's elements are not in ascending order.
std::vector<DicomElements> sequence_items(const DicomElements& of, DicomTag sequence);

/// With the elements of a frame's functional groups (0-based; PS3.3 C.7.6.16) at top level, as in a file of
/// one frame: spacing, distances, angles, flip, grey scale, time of the enhanced X-ray images.
DicomElements frame_elements(const DicomElements& of, int frame);

}  // namespace helicarm::xray
