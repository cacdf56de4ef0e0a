// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// The one of the `views` to come that an image is of: `wanted`, unless its positioner's angle plainly says
/// another. "AP" and "PA" are acquisition from before or behind, names that begin with "LAT" from a side.
std::string view_of(const Acquisition& shown, const std::string& wanted, std::span<const std::string> views);

/// Between the lines along which two images were acquisition, by their files; nothing where they do not say.
/// Equal angles say nothing: many C-arms write the same ones into every image.
std::optional<double> degrees_apart(const Acquisition& a, const Acquisition& b);

}  // namespace helicarm
