// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/knee_cone.h"

#include <fmt/format.h>

namespace helicarm::phantom {

Expected<KneeCone> cone_for_knee(double d1_mm, double d2_mm) {
  for (const auto& [name, value] : {std::pair{"d1", d1_mm}, {"d2", d2_mm}})
    if (!(value >= knee_range_mm.low && value <= knee_range_mm.high))
      return fail(Reason::bad_value, fmt::format("knee: {}: {} is not {:g} to {:g} mm", name, value,
                                                 knee_range_mm.low, knee_range_mm.high));
  return KneeCone{2 * d1_mm, d1_mm, 1.5 * d2_mm};
}

ConicalHelix helix_on(const KneeCone& cone) {
  ConicalHelix helix;
  helix.rr = cone.base_diameter_mm / 2;
  helix.pp = helix.t_end / std::log(cone.base_diameter_mm / cone.top_diameter_mm);
  helix.h = cone.height_mm / helix.t_end;
  return helix;
}

Calibrator calibrator_on(const ConicalHelix& helix, const std::string& name) {
  Calibrator calibrator = udcsc();
  calibrator.name = name;
  for (CalibratorBall& ball : calibrator.balls) {
    const double t = ball.centre_in_calibrator.z() / ConicalHelix().h;
    ball.centre_in_calibrator = helix.point(t);
  }
  return calibrator;
}

}  // namespace helicarm::phantom
