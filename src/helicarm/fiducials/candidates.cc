// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

namespace helicarm::fiducials {

Candidates detect_candidates(const xray::XrayImage& xray_image,
                             const rectification::Rectification& rectification) {
  if (rectification.other_dots) return {*rectification.other_dots};
  return {detection::dots_except(
      detection::find_dots(xray_image, rectification::metal_search(xray_image, rectification.metal)),
      rectification.plate_dots)};
}

}  // namespace helicarm::fiducials
