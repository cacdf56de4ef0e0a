// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/reason_code.h"

#include <algorithm>

namespace helicarm {

std::optional<Reason> reason_of(std::string_view word) {
  const auto all = all_reasons();
  const auto found = std::ranges::find(all, word, code);
  return found == all.end() ? std::nullopt : std::optional(*found);
}

}  // namespace helicarm
