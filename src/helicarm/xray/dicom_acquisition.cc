// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_acquisition.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/dicom_time.h"
#include "helicarm/xray/transfer_syntax.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace {

std::optional<double> one(const DicomElements& elements, DicomTag tag, double low, double high) {
  const auto value = elements.numbers(tag, 1, low, high);
  return value ? std::optional(value->front()) : std::nullopt;
}

/// Writers put 0 where they do not know a length. No other number is written without a digit of 1 to 9.
bool is_zero(const DicomElements& elements, DicomTag tag) {
  const std::string_view text = elements.text(tag);
  return text.find('0') != text.npos && text.find_first_not_of("0.+-\\ ") == text.npos;
}

/// Warns where the declared ratio of a pixel's height to its width contradicts the spacing.
void compare_aspect(const DicomElements& elements, const std::optional<std::vector<double>>& spacing,
                    std::vector<Warning>& warnings) {
  constexpr double tolerance = 0.01;
  if (is_zero(elements, tags::pixel_aspect_ratio)) return;
  const auto ratio = elements.numbers(tags::pixel_aspect_ratio, 2, 1e-6, 1e6);
  if (!ratio) return;
  const double stated = (*ratio)[0] / (*ratio)[1], measured = spacing ? (*spacing)[0] / (*spacing)[1] : 1;
  if (std::abs(stated / measured - 1) <= tolerance) return;
  warnings.push_back(
      {Reason::tag_disagrees,
       fmt::format(
           "{}: Pixel Aspect Ratio (0028,0034) is {}, but {}", elements.origin,
           quote(elements.text(tags::pixel_aspect_ratio)),
           spacing ? fmt::format("Imager Pixel Spacing (0018,1164) {}, which is used",
                                 quote(elements.text(tags::imager_pixel_spacing)))
                   : "the pixels are taken as square: the file gives no Imager Pixel Spacing (0018,1164)"),
       {},
       {{"stated_ratio", stated}, {"used_ratio", measured}}});
}

/// (row spacing, column spacing) in the file, (x, y) here.
std::optional<Eigen::Vector2d> spacing(const DicomElements& elements, std::vector<Warning>& warnings) {
  const bool zero = is_zero(elements, tags::imager_pixel_spacing);
  const auto imager =
      zero ? std::nullopt : elements.numbers(tags::imager_pixel_spacing, 2, min_pixel_mm, max_pixel_mm);
  const std::string_view calibrated = elements.text(tags::pixel_spacing);
  compare_aspect(elements, imager, warnings);
  if (!imager) {
    warnings.push_back(
        {Reason::spacing_missing,
         zero ? fmt::format("{}: Imager Pixel Spacing (0018,1164) is 0", elements.origin)
         : calibrated.empty()
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

/// PS3.3 C.8.7.5.1.3: one increment is the change from frame to frame, several are the frames' offsets from
/// the first angle.
std::optional<double> angle_of(const DicomElements& elements, DicomTag angle, DicomTag increment, int frame,
                               int frames, std::vector<Warning>& warnings) {
  const auto first = one(elements, angle, -360, 360);
  const std::size_t count = elements.count(increment);
  if (!first || frames == 1 || count == 0) return first;
  const auto unused = [&](std::string_view why) {
    warnings.push_back(
        {Reason::tag_disagrees, fmt::format("{}: {} ({:04X},{:04X}) {}", elements.origin, increment.name,
                                            increment.number >> 16, increment.number & 0xFFFF, why)});
  };
  const std::vector<double> increments = *elements.numbers(increment, count, -720, 720);
  if (count != 1 && count != static_cast<std::size_t>(frames)) {
    unused(fmt::format("has {} values for {} frames: the angle of this frame is not known", count, frames));
    return std::nullopt;
  }
  if (elements.text(tags::positioner_motion) == "STATIC" &&
      std::ranges::any_of(increments, [](double value) { return value != 0; })) {
    unused("states a motion, Positioner Motion (0018,1500) STATIC: the increments are not used");
    return first;
  }
  return *first + (count == 1 ? frame * increments[0] : increments[static_cast<std::size_t>(frame)]);
}

bool flipped(const DicomElements& elements) {
  const std::string_view flip = elements.text(tags::field_flip);
  if (!flip.empty() && flip != "YES" && flip != "NO")
    elements.refuse(Reason::bad_value, tags::field_flip,
                    fmt::format("is {}, must be YES or NO", quote(flip)));
  return flip == "YES";
}

/// In this file or an earlier one. JPEG-LS and JPEG 2000 may be lossless in the syntaxes that allow loss.
bool lossy(const DicomElements& elements) {
  const std::string_view stated = elements.text(tags::lossy_compression);
  const TransferSyntax& syntax = *transfer_syntax(elements.transfer_syntax);
  return stated == "01" || (syntax.may_be_lossy && (stated != "00" || syntax.coding == Coding::jpeg));
}

/// Elements that cannot name a person: codes and numbers of a limited length.
std::map<std::uint32_t, std::string> technique(const DicomElements& elements) {
  constexpr std::size_t longest = 64;
  std::map<std::uint32_t, std::string> values;
  for (const DicomTag tag : tags::technique) {
    const std::string_view value = elements.text(tag);
    const bool is_code = value.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 _.+-\\") == value.npos;
    if (!value.empty() && value.size() <= longest && is_code) values.emplace(tag.number, value);
  }
  return values;
}

}  // namespace

Expected<AcquisitionRead> read_acquisition(const DicomElements& elements, int frame, int frames) {
  return guarded([&] {
    AcquisitionRead read;
    Acquisition& a = read.acquisition;
    a.pixel_mm = spacing(elements, read.warnings);
    if (!is_zero(elements, tags::source_detector))
      a.source_detector_mm =
          one(elements, tags::source_detector, min_source_detector_mm, max_source_detector_mm);
    // Only a check: a value that cannot be (0 is common) is the same as none.
    a.source_patient_mm = one(elements, tags::source_patient, -1e6, 1e6);
    if (a.source_patient_mm && !(*a.source_patient_mm >= min_source_patient_mm)) a.source_patient_mm.reset();
    a.primary_angle_deg =
        angle_of(elements, tags::primary_angle, tags::primary_increment, frame, frames, read.warnings);
    a.secondary_angle_deg =
        angle_of(elements, tags::secondary_angle, tags::secondary_increment, frame, frames, read.warnings);
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
    if (!id.empty() || !name.empty()) a.patient_key = text_key(fmt::format("{}\n{}", id, name));
    a.study_key = text_key(elements.text(tags::study));
    a.frame_of_reference_key = text_key(elements.text(tags::frame_of_reference));
    a.technique = technique(elements);
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
