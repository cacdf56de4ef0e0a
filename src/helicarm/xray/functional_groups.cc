// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::xray {
namespace {

/// An element of a functional group, and where it stands in a file of one frame (PS3.3 C.8.19.6).
struct Grouped {
  DicomTag group, inner, outer;
};
constexpr std::array grouped = {
    Grouped{tags::frame_content, tags::frame_acquired, tags::acquisition_date_time},
    Grouped{tags::frame_pixels, tags::imager_pixel_spacing, tags::imager_pixel_spacing},
    Grouped{tags::frame_pixels, tags::intensity_relationship, tags::intensity_relationship},
    Grouped{tags::frame_pixels, tags::intensity_sign, tags::intensity_sign},
    Grouped{tags::field_of_view, tags::field_rotation, tags::field_rotation},
    Grouped{tags::field_of_view, tags::field_flip, tags::field_flip},
    Grouped{tags::positioner_position, tags::primary_angle, tags::primary_angle},
    Grouped{tags::positioner_position, tags::secondary_angle, tags::secondary_angle},
    Grouped{tags::xray_geometry, tags::source_detector, tags::source_detector}};

void set(std::vector<DicomElement>& elements, const DicomElement& element) {
  const auto at = std::ranges::lower_bound(elements, element.tag, {}, &DicomElement::tag);
  if (at != elements.end() && at->tag == element.tag)
    *at = element;
  else
    elements.insert(at, element);
}

}  // namespace

DicomElements frame_elements(const DicomElements& of, int frame) {
  DicomElements flat = of;
  const auto add = [&](const DicomElements& groups) {
    for (const Grouped& wanted : grouped)
      for (const DicomElements& item : sequence_items(groups, wanted.group))
        if (const DicomElement* found = item.find(wanted.inner))
          set(flat.elements, {wanted.outer.number, found->vr, found->value});
  };
  for (const DicomElements& shared : sequence_items(of, tags::shared_groups)) add(shared);
  const auto per_frame = sequence_items(of, tags::frame_groups);
  if (std::size_t(frame) < per_frame.size()) add(per_frame[std::size_t(frame)]);
  return flat;
}

}  // namespace helicarm::xray
