// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace helicarm::xray {

/// For tests: builds a DICOM file byte by byte so that any element can be invalid. Starts as a valid 8 x 6 XA
/// image of 12 bits with the values 100, 101, ...
class DicomBuilder {
 public:
  DicomBuilder() {
    text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.12.1").text(0x00080018, "UI", "2.25.17");
    text(0x00080060, "CS", "XA").text(0x00100010, "PN", "ANON").text(0x00100020, "LO", "1");
    text(0x00181110, "DS", "1000").text(0x00181164, "DS", "0.3\\0.2");
    text(0x00280004, "CS", "MONOCHROME2");
    word(0x00280002, 1).word(0x00280010, 6).word(0x00280011, 8);
    word(0x00280100, 16).word(0x00280101, 12).word(0x00280102, 11).word(0x00280103, 0);
    std::vector<std::uint16_t> values;
    for (std::uint16_t i = 0; i < 48; ++i) values.push_back(static_cast<std::uint16_t>(100 + i));
    pixels(values);
  }

  DicomBuilder& text(std::uint32_t tag, const char* vr, std::string value) {
    if (value.size() % 2 != 0) value += std::string_view(vr) == "UI" ? '\0' : ' ';
    return raw(tag, vr, std::move(value));
  }
  DicomBuilder& word(std::uint32_t tag, int value, const char* vr = "US") {
    return raw(tag, vr, number(value, 2));
  }
  DicomBuilder& raw(std::uint32_t tag, const char* vr, std::string value) {
    elements_[tag] = {vr, std::move(value)};
    return *this;
  }
  DicomBuilder& pixels(const std::vector<std::uint16_t>& values) {
    std::string bytes;
    for (std::uint16_t value : values) bytes += number(value, 2);
    return raw(0x7FE00010, "OW", bytes);
  }
  DicomBuilder& erase(std::uint32_t tag) {
    elements_.erase(tag);
    return *this;
  }
  DicomBuilder& syntax(std::string uid) {
    syntax_ = std::move(uid);
    return *this;
  }
  /// Pixel Data of undefined length: an empty offset table, then the fragments.
  DicomBuilder& fragments(const std::vector<std::string>& fragments, const std::string& offsets = "") {
    std::string items = item(offsets);
    for (const std::string& fragment : fragments)
      items += item(fragment.size() % 2 ? fragment + '\0' : fragment);
    elements_.erase(0x7FE00010);
    tail_ = tag_bytes(0x7FE00010) + "OB" + number(0, 2) + number(-1, 4) + items + tag_bytes(0xFFFEE0DD) +
            number(0, 4);
    return *this;
  }
  /// Appends bytes after the last element.
  DicomBuilder& tail(std::string bytes) {
    tail_ = std::move(bytes);
    return *this;
  }

  std::string bytes() const {
    const bool explicit_vr = syntax_ != "1.2.840.10008.1.2";
    std::string uid = syntax_;
    if (uid.size() % 2 != 0) uid += '\0';
    const std::string meta = element(0x00020010, "UI", uid, true);
    std::string file = std::string(128, '\0') + "DICM" +
                       element(0x00020000, "UL", number(static_cast<int>(meta.size()), 4), true) + meta;
    for (const auto& [tag, content] : elements_) file += element(tag, content.vr, content.value, explicit_vr);
    return file + tail_;
  }

  static std::string number(int value, int size) {
    std::string bytes;
    for (int i = 0; i < size; ++i) bytes += static_cast<char>(static_cast<unsigned>(value) >> (8 * i));
    return bytes;
  }
  static std::string tag_bytes(std::uint32_t tag) {
    return number(static_cast<int>(tag >> 16), 2) + number(static_cast<int>(tag & 0xFFFF), 2);
  }
  static std::string item(const std::string& content) {
    return tag_bytes(0xFFFEE000) + number(static_cast<int>(content.size()), 4) + content;
  }
  static std::string element(std::uint32_t tag, const std::string& vr, const std::string& value,
                             bool explicit_vr) {
    const int size = static_cast<int>(value.size());
    const bool wide = vr == "OB" || vr == "OW" || vr == "SQ" || vr == "UN";
    if (!explicit_vr) return tag_bytes(tag) + number(size, 4) + value;
    return tag_bytes(tag) + vr + (wide ? number(0, 2) + number(size, 4) : number(size, 2)) + value;
  }

 private:
  struct Content {
    std::string vr;
    std::string value;
  };
  std::map<std::uint32_t, Content> elements_;
  std::string syntax_ = "1.2.840.10008.1.2.1";
  std::string tail_;
};

}  // namespace helicarm::xray
