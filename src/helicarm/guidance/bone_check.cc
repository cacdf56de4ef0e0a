// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/bone_check.h"

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

double WallPlace::margin_mm() const { return distance_mm - one_sided_95 * drilled_sigma_mm; }

std::optional<WallPlace> BoneCheck::least_sure() const {
  std::optional<WallPlace> least;
  for (const auto* places : {&wall, &ahead})
    for (const WallPlace& place : *places)
      if (!least || place.margin_mm() < least->margin_mm()) least = place;
  return least;
}

bool BoneCheck::is_breach() const {
  if (!diameter_mm) return false;
  if (!entry) return true;
  const auto least = least_sure();
  return (least && least->margin_mm() < 0) ||
         (bridge_mm && *bridge_mm < one_sided_95 * drilled_sigma_mm.value_or(0)) ||
         (end_mm && *end_mm < one_sided_95 * drilled_end_sigma_mm.value_or(0));
}

bool BoneCheck::is_thin() const {
  return required_mm && ((bridge_mm && *bridge_mm < *required_mm) || (end_mm && *end_mm < *required_mm));
}

}  // namespace helicarm::guidance
