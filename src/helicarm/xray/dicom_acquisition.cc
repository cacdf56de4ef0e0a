// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_acquisition.h"

#include <fmt/format.h>

#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/dicom_time.h"
#include "helicarm/xray/digest.h"

namespace helicarm::xray {
namespace {

std::string key_of(std::string_view text) { return text.empty() ? std::string{} : digest(text); }

std::optional<double> one(const DicomElements& elements, DicomTag tag, double low, double high) {
  const auto value = elements.numbers(tag, 1, low, high);
  return value ? std::optional(value->front()) : std::nullopt;
}

/// (row spacing, column spacing) in the file, (x, y) here.
std::optional<Eigen::Vector2d> spacing(const DicomElements& elements, std::vector<Warning>& warnings) {
  const auto imager = elements.numbers(tags::imager_pixel_spacing, 2, min_pixel_mm, max_pixel_mm);
  const std::string_view calibrated = elements.text(tags::pixel_spacing);
  if (!imager) {
    warnings.push_back(
        {Reason::spacing_missing,
         calibrated.empty()
             ? fmt::format("{}: the file gives no Imager Pixel Spacing (0018,1164)", elements.origin)
             : fmt::format("{}: no Imager Pixel Spacing (0018,1164); Pixel Spacing (0028,0030) {} is "
                           "not used, its plane is unknown",
                           elements.origin, quote(calibrated))});
    return std::nullopt;
  }
  if (!calibrated.empty() && calibrated != elements.text(tags::imager_pixel_spacing))
    warnings.push_back(
        {Reason::tag_disagrees,
         fmt::format("{}: Imager Pixel Spacing (0018,1164) is used, not the differing Pixel Spacing "
                     "(0028,0030) {}",
                     elements.origin, quote(calibrated))});
  return Eigen::Vector2d((*imager)[1], (*imager)[0]);
}

bool flipped(const DicomElements& elements) {
  const std::string_view flip = elements.text(tags::field_flip);
  if (!flip.empty() && flip != "YES" && flip != "NO")
    elements.refuse(Reason::bad_value, tags::field_flip,
                    fmt::format("is {}, must be YES or NO", quote(flip)));
  return flip == "YES";
}

/// JPEG processes 1, 2 and 4, in this file or an earlier one.
bool lossy(const DicomElements& elements) {
  return elements.text(tags::lossy_compression) == "01" ||
         elements.transfer_syntax == "1.2.840.10008.1.2.4.50" ||
         elements.transfer_syntax == "1.2.840.10008.1.2.4.51";
}

}  // namespace

Expected<AcquisitionRead> read_acquisition(const DicomElements& elements) {
  return guarded([&] {
    AcquisitionRead read;
    Acquisition& a = read.acquisition;
    a.pixel_mm = spacing(elements, read.warnings);
    a.source_detector_mm =
        one(elements, tags::source_detector, min_source_detector_mm, max_source_detector_mm);
    // Only a check: a value that cannot be (0 is common) is the same as none.
    a.source_patient_mm = one(elements, tags::source_patient, -1e6, 1e6);
    if (a.source_patient_mm && !(*a.source_patient_mm >= min_source_patient_mm)) a.source_patient_mm.reset();
    a.primary_angle_deg = one(elements, tags::primary_angle, -360, 360);
    a.secondary_angle_deg = one(elements, tags::secondary_angle, -360, 360);
    a.acquired = acquisition_time(elements);
    if (lossy(elements))
      read.warnings.push_back(
          {Reason::lossy_image, fmt::format("{}: the image was compressed with loss", elements.origin)});
    a.flip_hint = flipped(elements);
    a.rotation_hint_deg = one(elements, tags::field_rotation, -360, 360).value_or(0);
    const std::string_view relationship = elements.text(tags::intensity_relationship);
    if (relationship == "LOG" || relationship == "LIN") a.logarithmic = relationship == "LOG";
    a.modality = elements.text(tags::modality);
    const std::string_view id = elements.text(tags::patient_id), name = elements.text(tags::patient_name);
    if (!id.empty() || !name.empty()) a.patient_key = digest(fmt::format("{}\n{}", id, name));
    a.study_key = key_of(elements.text(tags::study));
    a.frame_of_reference_key = key_of(elements.text(tags::frame_of_reference));
    return read;
  });
}

Expected<Polarity> read_polarity(const DicomOutline& outline) {
  return guarded([&] {
    const DicomElements& elements = outline.elements;
    const std::string_view shape = elements.text(tags::lut_shape);
    if (!shape.empty() && shape != "IDENTITY" && shape != "INVERSE")
      elements.refuse(Reason::bad_value, tags::lut_shape,
                      fmt::format("is {}, must be IDENTITY or INVERSE", quote(shape)));
    const bool shown_inverse = outline.monochrome1 || shape == "INVERSE";
    const auto sign = elements.word(tags::intensity_sign, "SS");
    if (!sign) return Polarity{shown_inverse, false};
    if (*sign != 1 && *sign != 0xFFFF)
      elements.refuse(Reason::bad_value, tags::intensity_sign,
                      fmt::format("is {}, must be 1 or -1", static_cast<std::int16_t>(*sign)));
    const bool invert = *sign != 1;
    return Polarity{invert, invert || !shown_inverse};
  });
}

}  // namespace helicarm::xray
