// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// The missing view that an image belongs to: `wanted`, unless its positioner angle clearly indicates
/// another. "AP" and "PA" are frontal, names that begin with "LAT" lateral.
std::string view_of(const Acquisition& shown, const std::string& wanted, std::span<const std::string> views);

/// "AP" or "LAT" by the positioner angle; nothing if it is missing or oblique.
std::optional<std::string> kind_of_view(const Acquisition& shown);

/// Angle between the viewing directions of two images, from their files; empty if not stated. Equal angles
/// count as not stated: many C-arms write the same ones into every image.
std::optional<double> degrees_apart(const Acquisition& a, const Acquisition& b);

}  // namespace helicarm::xray
