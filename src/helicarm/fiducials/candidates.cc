// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

namespace helicarm {

Candidates detect_candidates(const XrayImage& xray_image, const Rectification& rectification) {
  if (rectification.other_dots) return {*rectification.other_dots};
  return {dots_except(find_dots(xray_image, metal_search(xray_image, rectification.metal)),
                      rectification.plate_dots)};
}

}  // namespace helicarm
