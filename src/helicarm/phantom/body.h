// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/mesh.h"

namespace helicarm::phantom {

enum class BodyShape {
  cone,   ///< 2.3.1 and 2.3.4: balls on the wall of a cone about z
  rings,  ///< any layout: a ring about the balls' axis through each ball, and four ribs
  plate   ///< any layout: a plate below the balls, and a post up to each
};

/// The plastic body of 2.3.1 and 2.3.4 in the calibrator's frame: a truncated cone on a flange, open at the
/// base and closed at the top.
struct BodyOptions {
  BodyShape shape = BodyShape::cone;
  double clearance_mm = 0;        ///< pocket's diameter less the ball's; negative: press fit; -0.5 to 2
  double base_diameter_mm = 120;  ///< of the outer surface at z = 0
  double top_diameter_mm = 60;    ///< at z = height_mm
  double height_mm = 87.5;
  double wall_mm = 3;          ///< also around each ball's pocket, less at the surface
  double flange_depth_mm = 5;  ///< below z = 0, holds the lowest ball
  double flange_width_mm = 8;
  double groove_width_mm = 2;
  double groove_depth_mm = 1;
  double facet_side_mm = 18;  ///< side of the four flat squares for the tracker's markers
  double step_mm = 1;         ///< of the grid; 0.2 to 3
};

/// Signed distance (mm, negative in the plastic): exact near the shell, a bound elsewhere.
SignedDistance body_distance(const Calibrator& calibrator, const BodyOptions& options = {});

/// The printable surface, that of the grid simplified within 0.02 mm. Each ball has a blind pocket of its own
/// diameter and the clearance, open to the outside (plate: upwards); grooves of the cone connect balls named
/// as in 2.3.4. Refuses (bad_value) a ball outside the cone's wall, a ball in another one's post, and a step
/// or clearance out of range.
Expected<TriangleMesh> printable_body(const Calibrator& calibrator, const BodyOptions& options = {});

/// Cone if every ball lies on the wall, else rings.
BodyShape suitable_shape(const Calibrator& calibrator, const BodyOptions& options = {});

}  // namespace helicarm::phantom
