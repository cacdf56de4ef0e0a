// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/case_registration/plan.h"

namespace helicarm::case_registration {

/// Whether a file is 3D Slicer's list of points of before version 5 (.fcsv), by its name or first line.
bool is_fcsv(const std::filesystem::path& path, std::string_view bytes);

/// Its points that are placed, in L, P, S and mm. Coordinate system and columns must be declared by its
/// comments. Throws BadInput: bad_value, not_finite, truncated, unsupported, bad_size.
std::vector<PlanPoint> fcsv_points(std::string_view bytes, const std::string& origin);

}  // namespace helicarm::case_registration
