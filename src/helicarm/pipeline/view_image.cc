// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/view_image.h"

#include <fmt/format.h>

#include "helicarm/xray/read_xray_image.h"

namespace helicarm::pipeline {
namespace {

Expected<xray::XrayImage> read_as_stated(const std::filesystem::path& file, std::optional<int> frame,
                                         const CaseView& view) {
  return guarded([&] {
    xray::XrayImage image = value_or_throw(xray::read_xray_image(file, view.name, frame));
    auto agreed = xray::state_geometry(image,
                                       {.pixel_mm = view.pixel_mm,
                                        .source_detector_mm = view.source_detector_mm,
                                        .primary_deg = view.primary_deg,
                                        .secondary_deg = view.secondary_deg},
                                       fmt::format("case.json: view {}", view.name));
    if (!agreed) {
      agreed.error().view = view.name;
      throw BadInput(agreed.error());
    }
    return image;
  });
}

}  // namespace

Expected<xray::XrayImage> image_of(const CaseView& view) {
  return read_as_stated(view.image, view.frame, view);
}

Expected<xray::XrayImage> plate_image_of(const CaseView& view) {
  return read_as_stated(*view.plate_image, std::nullopt, view);
}

}  // namespace helicarm::pipeline
