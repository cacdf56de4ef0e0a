// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

namespace helicarm::fiducials {

Candidates detect_candidates(const xray::XrayImage& xray_image,
                             const rectification::Rectification& rectification, double least_radius_px) {
  detection::DotOptions search = rectification::metal_search(xray_image, rectification.metal);
  search.min_radius_px = std::max(search.min_radius_px, least_radius_px);
  std::vector<detection::Dot> known;
  if (rectification.other_dots) {
    known = *rectification.other_dots;
    if (search.min_radius_px >= rectification.other_dots_from_px) return {std::move(known)};
    search.max_radius_px = rectification.other_dots_from_px;
  }
  const std::vector<detection::Dot> found = detection::dots_except(
      detection::dots_except(detection::find_dots(xray_image, search), rectification.plate_dots), known);
  known.insert(known.end(), found.begin(), found.end());
  return {std::move(known)};
}

}  // namespace helicarm::fiducials
