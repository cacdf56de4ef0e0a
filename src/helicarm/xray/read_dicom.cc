// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_dicom.h"

#include <fmt/format.h>

#include "helicarm/xray/dicom_acquisition.h"
#include "helicarm/xray/dicom_frame.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/digest.h"
#include "helicarm/xray/polarity.h"

namespace helicarm {

Expected<int> choose_frame(const std::string& origin, int frames, std::optional<int> frame) {
  if (!frame && frames > 1)
    return fail(Reason::bad_value,
                fmt::format("{}: \"frame\" is missing: the file has {} frames, say which (1 to {})", origin,
                            frames, frames));
  if (frame && (*frame < 1 || *frame > frames))
    return fail(Reason::bad_value,
                fmt::format("{}: \"frame\" is {}, must be 1 to {}", origin, *frame, frames));
  return frame.value_or(1) - 1;
}

void invert(Exposure& exposure) {
  const float sum = exposure.lowest + exposure.highest;
  for (float& pixel : exposure.pixels.pixels()) pixel = sum - pixel;
}

void make_metal_dark(Exposure& exposure, const std::string& origin) {
  if (!metal_looks_bright(exposure.pixels).value_or(false)) return;
  invert(exposure);
  exposure.warnings.push_back(
      {Reason::tag_disagrees, fmt::format("{}: metal looks bright; the grey values were inverted", origin)});
}

std::string picture_key(const Image<float>& pixels) {
  const auto values = pixels.pixels();
  return digest(fmt::format("{} {} {}", pixels.width(), pixels.height(),
                            digest({reinterpret_cast<const char*>(values.data()), values.size_bytes()})));
}

Expected<Exposure> read_dicom(std::string_view bytes, const std::string& origin, std::optional<int> frame) {
  return guarded([&] {
    const DicomOutline outline = value_or_throw(check_dicom(bytes, origin));
    auto [acquisition, warnings] = value_or_throw(read_acquisition(outline.elements));
    const Polarity polarity = value_or_throw(read_polarity(outline));
    const int index = value_or_throw(choose_frame(origin, outline.frames, frame));

    Exposure exposure;
    exposure.pixels = value_or_throw(decode_frame(outline, index));
    const auto levels = static_cast<float>(1 << outline.bits_stored);
    exposure.lowest = outline.is_signed ? -levels / 2 : 0;
    exposure.highest = exposure.lowest + levels - 1;
    exposure.acquisition = std::move(acquisition);
    exposure.warnings = std::move(warnings);
    if (polarity.invert) invert(exposure);
    if (!polarity.certain) make_metal_dark(exposure, origin);
    exposure.acquisition.instance_key = picture_key(exposure.pixels);
    exposure.acquisition.uid_key =
        digest(fmt::format("{} {}", outline.elements.text(tags::sop_instance), index));
    return exposure;
  });
}

}  // namespace helicarm
