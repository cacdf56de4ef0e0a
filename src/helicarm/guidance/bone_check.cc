// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/bone_check.h"

#include <algorithm>

namespace helicarm::guidance {
namespace {

constexpr double one_sided_95 = 1.645;

}  // namespace

std::string_view words(NoEntry reason) {
  switch (reason) {
    case NoEntry::beyond_ct:
      return "enters or leaves the bone where the CT ends, which shows no surface there, or ends beyond it";
    case NoEntry::opens_nowhere:
      return "opens nowhere: its start is more than 5 mm below the bone's surface, and so is its end";
    case NoEntry::beside_bone:
      break;
  }
  return "does not pass through the bone";
}

bool BoneCheck::is_breach() const {
  if (!diameter_mm) return false;
  if (!entry) return true;
  const double spread = drilled_sigma_mm.value_or(0);
  return (bridge_mm && *bridge_mm < one_sided_95 * spread) ||
         (end_mm && *end_mm < one_sided_95 * std::max(spread, end_sigma_mm.value_or(0)));
}

bool BoneCheck::is_thin() const {
  return required_mm && ((bridge_mm && *bridge_mm < *required_mm) || (end_mm && *end_mm < *required_mm));
}

}  // namespace helicarm::guidance
