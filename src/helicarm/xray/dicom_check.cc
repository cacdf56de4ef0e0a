// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_check.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/image/grey_image.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::xray {
namespace {

constexpr int max_side = image::max_image_side;

/// XA, RF, enhanced XA and XRF, CR, DX (for presentation and processing), secondary capture (single,
/// multi-frame byte and word).
constexpr std::array<std::string_view, 10> xray_classes = {
    "1.2.840.10008.5.1.4.1.1.12.1",   "1.2.840.10008.5.1.4.1.1.12.2", "1.2.840.10008.5.1.4.1.1.12.1.1",
    "1.2.840.10008.5.1.4.1.1.12.2.1", "1.2.840.10008.5.1.4.1.1.1",    "1.2.840.10008.5.1.4.1.1.1.1",
    "1.2.840.10008.5.1.4.1.1.1.1.1",  "1.2.840.10008.5.1.4.1.1.7",    "1.2.840.10008.5.1.4.1.1.7.2",
    "1.2.840.10008.5.1.4.1.1.7.3"};

/// A secondary capture may have any content; these modalities can be X-ray images.
constexpr std::array<std::string_view, 9> xray_modalities = {"XA", "RF", "CR", "DX", "DR",
                                                             "RG", "OT", "SC", ""};

void check_xray(const DicomElements& elements) {
  const std::string_view sop_class = elements.text(tags::sop_class);
  if (sop_class.empty() && !elements.find(tags::pixel_data))
    elements.refuse(Reason::not_an_image, tags::pixel_data, "is missing: the file contains no image");
  if (!is_xray_class(sop_class))
    elements.refuse(Reason::unsupported, tags::sop_class,
                    fmt::format("is {}: not an XA, RF, CR, DX or secondary capture image", quote(sop_class)));
  const std::string_view modality = elements.text(tags::modality);
  if (std::ranges::find(xray_modalities, modality) == xray_modalities.end())
    elements.refuse(Reason::unsupported, tags::modality, fmt::format("is {}: not an X-ray", quote(modality)));
}

void check_kind(const DicomElements& elements, DicomKind kind) {
  if (kind == DicomKind::xray)
    check_xray(elements);
  else if (elements.text(tags::sop_class) != ct_class)
    elements.refuse(Reason::unsupported, tags::sop_class,
                    fmt::format("is {}: not a CT slice", quote(elements.text(tags::sop_class))));
  if (elements.text(tags::sop_instance).empty())
    elements.refuse(Reason::bad_value, tags::sop_instance, "is missing");
  if (!elements.find(tags::pixel_data)) elements.refuse(Reason::bad_value, tags::pixel_data, "is missing");
}

void warn(DicomOutline& outline, Reason reason, std::string message) {
  outline.warnings.push_back({reason, std::move(message), {}, {}});
}

int whole(const DicomElements& elements, DicomTag tag, int low, int high, Reason reason = Reason::bad_value) {
  const auto value = elements.word(tag, "US");
  if (!value) elements.refuse(Reason::bad_value, tag, "is missing");
  if (*value < low || *value > high)
    elements.refuse(reason, tag, fmt::format("is {}, must be {} to {}", *value, low, high));
  return *value;
}

void check_photometric(DicomOutline& outline) {
  const DicomElements& elements = outline.elements;
  const std::string_view photometric = elements.text(tags::photometric);
  outline.monochrome1 = photometric == "MONOCHROME1";
  if (!outline.monochrome1 && photometric != "MONOCHROME2")
    elements.refuse(Reason::unsupported, tags::photometric,
                    fmt::format("is {}, must be MONOCHROME1 or MONOCHROME2", quote(photometric)));
  if (const auto samples = elements.word(tags::samples_per_pixel, "US"); samples != 1)
    elements.refuse(Reason::unsupported, tags::samples_per_pixel, "is not 1");
}

void check_bits(DicomOutline& outline) {
  const DicomElements& elements = outline.elements;
  outline.bits_allocated = whole(elements, tags::bits_allocated, 8, 16);
  if (outline.bits_allocated % 8 != 0)
    elements.refuse(Reason::bad_value, tags::bits_allocated,
                    fmt::format("is {}, must be 8 or 16", outline.bits_allocated));
  outline.bits_stored = whole(elements, tags::bits_stored, 8, outline.bits_allocated);
  const int high_bit = whole(elements, tags::high_bit, outline.bits_stored - 1, outline.bits_allocated - 1);
  outline.lowest_bit = high_bit + 1 - outline.bits_stored;
  if (outline.lowest_bit > 0)
    warn(outline, Reason::irregular_file,
         fmt::format(
             "{}: High Bit (0028,0102) is {}, Bits Stored (0028,0101) {}: the values are taken from bits "
             "{} to {}, or from 0 to {} if all above these are 0",
             elements.origin, high_bit, outline.bits_stored, outline.lowest_bit, high_bit,
             outline.bits_stored - 1));
  outline.is_signed = whole(elements, tags::pixel_representation, 0, 1) == 1;
}

void check_fragments(DicomOutline& outline) {
  const auto [frames, images] = fragments_of_frames(outline.elements, outline.frames);
  outline.frame_fragments = frames;
  if (images > frames.size())
    warn(outline, Reason::surplus_data,
         fmt::format(
             "{}: Pixel Data (7FE0,0010) holds {} compressed images, Number of Frames (0028,0008) says {}: "
             "the rest is not read",
             outline.elements.origin, images, outline.frames));
}

void check_size(DicomOutline& outline) {
  const DicomElements& elements = outline.elements;
  outline.rows = whole(elements, tags::rows, 1, max_side, Reason::bad_size);
  outline.columns = whole(elements, tags::columns, 1, max_side, Reason::bad_size);
  const double frames = elements.numbers(tags::frames, 1, 1, 100000).value_or(std::vector{1.0})[0];
  if (frames != std::floor(frames)) elements.refuse(Reason::bad_value, tags::frames, "is not a whole number");
  outline.frames = static_cast<int>(frames);

  const auto frame_bytes = static_cast<std::size_t>(outline.rows) *
                           static_cast<std::size_t>(outline.columns) *
                           static_cast<std::size_t>(outline.bits_allocated / 8);
  if (frame_bytes > image::max_image_bytes)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} bytes a frame, limit {}", elements.origin,
                                                 frame_bytes, image::max_image_bytes));
  if (outline.encapsulated()) return check_fragments(outline);
  outline.pixel_data = elements.find(tags::pixel_data)->value;
  const std::size_t needed = frame_bytes * static_cast<std::size_t>(outline.frames);
  if (outline.pixel_data.size() < needed)
    elements.refuse(
        Reason::truncated, tags::pixel_data,
        fmt::format("has {} bytes, {} x {} pixels in {} frame(s) need {}", outline.pixel_data.size(),
                    outline.columns, outline.rows, outline.frames, needed));
  // An odd number of bytes is padded by one.
  if (const std::size_t surplus = outline.pixel_data.size() - needed; surplus > needed % 2)
    warn(outline, Reason::surplus_data,
         fmt::format(
             "{}: Pixel Data (7FE0,0010) has {} bytes, {} x {} pixels of {} bits in {} frame(s) need {}: the "
             "rest is not read; check Rows, Columns, Bits Allocated and Number of Frames",
             elements.origin, outline.pixel_data.size(), outline.columns, outline.rows,
             outline.bits_allocated, outline.frames, needed));
}

}  // namespace

bool is_xray_class(std::string_view sop_class) {
  return std::ranges::find(xray_classes, sop_class) != xray_classes.end();
}

Expected<DicomOutline> check_dicom(std::string_view bytes, const std::string& origin, DicomKind kind) {
  return guarded([&] {
    DicomOutline outline;
    outline.elements = value_or_throw(walk_dicom(bytes, origin));
    check_kind(outline.elements, kind);
    if (!outline.elements.irregular.empty())
      warn(outline, Reason::irregular_file,
           outline.elements.irregular + ": the file breaks a rule of DICOM and was read all the same");
    check_photometric(outline);
    check_bits(outline);
    check_size(outline);
    return outline;
  });
}

}  // namespace helicarm::xray
