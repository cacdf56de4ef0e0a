// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/devices/tracker/igtl_message.h"

namespace helicarm::tracker {

/// Names in TRANSFORM and TDATA messages have 20 characters at most.
inline constexpr std::size_t longest_tool_name = 20;

/// Name of a TRANSFORM's or POSITION's tool. PLUS sends a name that is longer than the field as metadata.
inline std::string tool_name(const IgtlMessage& message) {
  const auto whole = message.metadata.find("IGTL_DEVICE_NAME");
  return whole != message.metadata.end() && whole->second.starts_with(message.device) ? whole->second
                                                                                      : message.device;
}

/// False if the metadata states a status other than OK for this tool: `TransformStatus` (TRANSFORM), or as
/// PLUS sends it with TDATA, the transform's whole name followed by `Status`.
inline bool is_visible(const IgtlMessage& message, std::string_view tool) {
  constexpr std::string_view status = "Status";
  for (const auto& [key, value] : message.metadata) {
    if (value == "OK" || !key.ends_with(status)) continue;
    const std::string_view name = std::string_view(key).substr(0, key.size() - status.size());
    const bool is_truncated = tool.size() == longest_tool_name && name.starts_with(tool);
    if (name == "Transform" || name == tool || is_truncated || name == std::string(tool) + "Transform")
      return false;
  }
  return true;
}

}  // namespace helicarm::tracker
