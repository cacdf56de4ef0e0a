// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm {

/// The inverse of `code`; nothing for a word that is no code.
std::optional<Reason> reason_of(std::string_view code);

}  // namespace helicarm
