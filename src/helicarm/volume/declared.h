// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

namespace helicarm::volume {

/// With small letters (ASCII).
std::string small_letters(std::string_view text);

/// Length of a unit of length ("mm", "cm", "microns", "inch", ...; letters of either case) in mm; nothing for
/// another word.
std::optional<double> unit_in_mm(std::string_view unit);

/// `unit_in_mm` of the value of a field. Throws BadInput (unsupported) that names field and value.
double declared_unit(std::string_view unit, const std::string& field);

/// Signs of the axes from a patient space ("LPS", "right-anterior-superior", ...; letters of either case) to
/// L, P, S; nothing for another space.
std::optional<Eigen::Vector3d> signs_to_lps(std::string_view space);

/// `signs_to_lps` of the value of a field. Throws BadInput (unsupported) that names field and value.
Eigen::Vector3d declared_space(std::string_view space, const std::string& field);

/// Space and unit that a header or comment states as 3D Slicer and others write them ("SPACE=RAS",
/// "units: cm"), as in the text; empty if it states none. After "=" or ":" any word counts, else only a
/// known one. Throws BadInput (bad_value) for two different values of one.
struct Declared {
  std::string space, unit;
};
Declared declared_in(std::string_view text, const std::string& origin);

}  // namespace helicarm::volume
