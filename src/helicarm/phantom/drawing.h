// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"

namespace helicarm::phantom {

/// SVG, 1 : 1 in mm, dimensioned, seen from the source. Refuses (bad_value) an unbounded lattice.
Expected<std::string> drawing_of(const Plate& plate);

/// SVG, 1 : 1 in mm: the balls and targets from above (along -z) and from the side (along +y), with labels
/// and a table of all coordinates and diameters.
std::string drawing_of(const Calibrator& calibrator);

}  // namespace helicarm::phantom
