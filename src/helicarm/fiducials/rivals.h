// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/fiducials/hypothesis.h"

namespace helicarm {

/// Log odds of `h` against `rival` by each candidate's own error instead of the general figure; all errors
/// are enlarged by what the better fit of the two leaves beyond chance. Nothing where the candidates have
/// none.
std::optional<double> fine_margin(const Scene& scene, const Hypothesis& h, const Hypothesis& rival);

}  // namespace helicarm
