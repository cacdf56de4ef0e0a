// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

namespace helicarm {

Candidates detect_candidates(const Exposure& exposure, const Rectification& rectification) {
  if (rectification.other_dots) return {*rectification.other_dots};
  return {dots_except(find_dots(exposure, metal_search(exposure, rectification.metal)),
                      rectification.plate_dots)};
}

}  // namespace helicarm
