// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/measures/measure.h"
#include "helicarm/measures/roles.h"

namespace helicarm::measures {

/// outside_reference, for each component of a position that lies outside 0 to 100 % by more than its 95 %
/// error. Below -10 or above 110 % it names the clicks whose exchange gives a position inside. `points` has
/// the clicks' places, `point` is the position's.
std::vector<Warning> reference_warnings(const PercentAxes& axes, const Position& position,
                                        const PlanarPoints& points, std::size_t point);

}  // namespace helicarm::measures
