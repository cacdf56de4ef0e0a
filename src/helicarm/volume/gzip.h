// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace helicarm::volume {

/// The bytes as a gzip file without time and name: equal bytes give equal files. `level`: 1 (fast) to 9, -1
/// for zlib's own choice.
std::string gzip(std::string_view bytes, int level = -1);

}  // namespace helicarm::volume
