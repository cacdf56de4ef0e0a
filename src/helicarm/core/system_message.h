// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <system_error>

namespace helicarm {

/// The system's text for an errno: "No such file or directory". Unlike std::strerror it may be called by
/// several threads.
inline std::string system_message(int error) { return std::generic_category().message(error); }

}  // namespace helicarm
