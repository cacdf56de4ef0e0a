// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

/// Limit for an inflated data set.
inline constexpr std::size_t max_inflated_bytes = std::size_t{512} << 20;

/// The data set of a file in the deflated syntax (RFC 1951, PS3.5 A.5). Refuses truncated, bad_value
/// (damaged, or larger than `most_bytes`).
Expected<std::string> inflated(std::string_view deflated, const std::string& origin,
                               std::size_t most_bytes = max_inflated_bytes);

/// A big-endian file, of checked structure, as a little-endian one. Refuses bad_value.
Expected<std::string> as_little_endian(std::string_view file, const std::string& origin);

}  // namespace helicarm::xray
