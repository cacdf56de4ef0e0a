// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/same_image.h"

#include <map>

#include "helicarm/xray/dicom_frame.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::xray {
namespace {

bool is_sequence(const DicomElement* element) {
  return element && std::string_view(element->vr.data(), 2) == "SQ";
}

/// Values outside sequences: an implicit file does not tell which are sequences, the other one does.
std::map<std::uint32_t, std::string_view> values(const DicomElements& of, const DicomElements& other) {
  std::map<std::uint32_t, std::string_view> values;
  for (const DicomElement& element : of.elements) {
    const DicomTag tag{element.tag, ""};
    const bool is_group_length = (element.tag & 0xFFFF) == 0;
    if (is_group_length || element.tag == tags::pixel_data.number || is_sequence(&element) ||
        is_sequence(other.find(tag)))
      continue;
    values.emplace(element.tag, of.text(tag));
  }
  return values;
}

}  // namespace

bool same_image(std::string_view file, std::string_view other) {
  const auto a = check_dicom(file, ""), b = check_dicom(other, "");
  if (!a || !b || a->frames != b->frames ||
      values(a->elements, b->elements) != values(b->elements, a->elements))
    return false;
  for (int frame = 0; frame < a->frames; ++frame) {
    const auto one = decode_frame(*a, frame), another = decode_frame(*b, frame);
    if (!one || !another || !std::ranges::equal(one->pixels(), another->pixels())) return false;
  }
  return true;
}

}  // namespace helicarm::xray
