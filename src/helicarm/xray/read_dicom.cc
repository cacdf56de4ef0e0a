// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_dicom.h"

#include <fmt/format.h>

#include "helicarm/xray/dicom_acquisition.h"
#include "helicarm/xray/dicom_frame.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/digest.h"
#include "helicarm/xray/polarity.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {

Expected<int> choose_frame(const std::string& origin, int frames, std::optional<int> frame) {
  if (!frame && frames > 1)
    return fail(Reason::bad_value,
                fmt::format("{}: \"frame\" is missing: the file has {} frames, set it to 1 to {}", origin,
                            frames, frames));
  if (frame && (*frame < 1 || *frame > frames))
    return fail(Reason::bad_value,
                fmt::format("{}: \"frame\" is {}, must be 1 to {}", origin, *frame, frames));
  return frame.value_or(1) - 1;
}

void invert(XrayImage& xray_image) {
  const float sum = xray_image.lowest + xray_image.highest;
  for (float& pixel : xray_image.pixels.pixels()) pixel = sum - pixel;
}

void make_metal_dark(XrayImage& xray_image, const std::string& origin) {
  if (!metal_looks_bright(xray_image.pixels).value_or(false)) return;
  invert(xray_image);
  xray_image.inverted = {Reason::tag_disagrees,
                         fmt::format("{}: metal is bright; the grey values were inverted", origin)};
  xray_image.warnings.push_back(*xray_image.inverted);
}

float highest_grey(const image::Image<float>& pixels) {
  std::uint32_t used = 0;
  for (const float grey : pixels.pixels()) used |= static_cast<std::uint32_t>(grey);
  if (used == 0) return 65535;
  const int highest_bit = std::max(8, static_cast<int>(std::bit_width(used)));
  const int lowest_bit = highest_bit == 16 ? std::countr_zero(used) : 0;
  return static_cast<float>((1u << highest_bit) - (1u << lowest_bit));
}

std::string image_key(const image::Image<float>& pixels) {
  const auto values = pixels.pixels();
  return digest(fmt::format("{} {} {}", pixels.width(), pixels.height(),
                            digest({reinterpret_cast<const char*>(values.data()), values.size_bytes()})));
}

Expected<XrayImage> read_dicom(std::string_view bytes, const std::string& origin, std::optional<int> frame) {
  return check_dicom(bytes, origin).and_then([&](const DicomOutline& file) {
    return read_dicom_frame(file, frame);
  });
}

Expected<XrayImage> read_dicom_frame(const DicomOutline& file, std::optional<int> frame) {
  return guarded([&] {
    const int index = value_or_throw(choose_frame(file.elements.origin, file.frames, frame));
    DicomOutline outline = file;
    outline.elements = frame_elements(outline.elements, index);
    auto [acquisition, warnings] = value_or_throw(read_acquisition(outline.elements, index, outline.frames));
    const Polarity polarity = value_or_throw(read_polarity(outline));

    XrayImage xray_image;
    xray_image.pixels = value_or_throw(decode_frame(outline, index));
    const auto levels = static_cast<float>(1 << outline.bits_stored);
    xray_image.lowest = outline.is_signed ? -levels / 2 : 0;
    xray_image.highest = outline.bits_stored == 16 && !outline.is_signed ? highest_grey(xray_image.pixels)
                                                                         : xray_image.lowest + levels - 1;
    xray_image.acquisition = std::move(acquisition);
    xray_image.warnings = outline.warnings;
    std::ranges::move(warnings, std::back_inserter(xray_image.warnings));
    if (polarity.invert) invert(xray_image);
    if (!polarity.certain) make_metal_dark(xray_image, outline.elements.origin);
    xray_image.acquisition.instance_key = image_key(xray_image.pixels);
    xray_image.acquisition.uid_key =
        text_key(fmt::format("{} {}", outline.elements.text(tags::sop_instance), index));
    return xray_image;
  });
}

}  // namespace helicarm::xray
