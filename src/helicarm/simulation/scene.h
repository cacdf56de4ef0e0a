// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/solid.h"

namespace helicarm::simulation {

/// Linear attenuation (1/mm) at 40, 60 and 80 keV: a 70 kV beam is taken as these three lines.
using Attenuation = Eigen::Array3d;

/// The part of the open beam's signal that each line carries.
inline const Eigen::Array3d beam{0.25, 0.45, 0.30};

/// Density times the mass attenuation of NIST's tables (Hubbell and Seltzer 2004).
namespace material {
inline const Attenuation steel{2.856, 0.948, 0.468};
inline const Attenuation cortical_bone{0.1278, 0.0604, 0.0428};
inline const Attenuation spongy_bone{0.0500, 0.0310, 0.0255};
inline const Attenuation muscle{0.0282, 0.0215, 0.0191};
inline const Attenuation plastic{0.0280, 0.0229, 0.0208};
}  // namespace material

/// One material in one or several solids; where they overlap it counts once. What lies inside another body is
/// given by the difference of the attenuations, which may be negative (a hole in plastic, marrow in bone).
struct Body {
  std::string name;
  std::vector<Solid> solids;
  Attenuation attenuation;
  bool metal = false;  ///< sharp and dark enough for supersampling and for hiding balls
};

using Scene = std::vector<Body>;

Body steel(std::string name, std::vector<Solid> solids);
Body moved(Body body, const RigidTransform& a_from_b);

/// Signal behind the scene along a ray, as a part of the open beam's.
double transmission(const Scene& scene, const Eigen::Vector3d& source, const Eigen::Vector3d& direction);

}  // namespace helicarm::simulation
