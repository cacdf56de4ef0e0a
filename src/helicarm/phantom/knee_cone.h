// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/conical_helix.h"

namespace helicarm::phantom {

/// The truncated cone about a knee, mm (2.3.1, Fig. 4).
struct KneeCone {
  double base_diameter_mm;
  double top_diameter_mm;
  double height_mm;
};

inline constexpr Range knee_range_mm{20, 150};  ///< of d1 and d2

/// The paper's proportions: base 2 d1, top d1, height 1.5 d2; d1 is the width between the lateral femoral
/// wall and the medial condyle, d2 the height from the top of the knee to the resident's ridge. bad_value
/// outside `knee_range_mm`.
Expected<KneeCone> cone_for_knee(double d1_mm, double d2_mm);

/// Eq. 9 from the cone's base to its top in 3.5 turns.
ConicalHelix helix_on(const KneeCone& cone);

/// udcsc's twelve balls at the same angles of another helix.
Calibrator calibrator_on(const ConicalHelix& helix, const std::string& name);

}  // namespace helicarm::phantom
