// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/solid.h"

namespace helicarm::simulation {

/// Linear attenuation (1/mm) at 40, 60 and 80 keV: three lines that approximate a 70 kV beam.
using Attenuation = Eigen::Array3d;

/// Fraction of the open beam's signal in each line.
inline const Eigen::Array3d beam{0.25, 0.45, 0.30};

/// Density times the mass attenuation coefficient of the NIST tables (Hubbell and Seltzer 2004).
namespace material {
inline const Attenuation steel{2.856, 0.948, 0.468};
inline const Attenuation cortical_bone{0.1278, 0.0604, 0.0428};
inline const Attenuation spongy_bone{0.0500, 0.0310, 0.0255};
inline const Attenuation muscle{0.0282, 0.0215, 0.0191};
inline const Attenuation plastic{0.0280, 0.0229, 0.0208};
}  // namespace material

/// One material in one or several solids; overlaps count once. For a body inside another the attenuation is
/// the difference to the outer one and may be negative (a hole in plastic, marrow in bone).
struct Body {
  std::string name;
  std::vector<Solid> solids;
  Attenuation attenuation;
  bool metal = false;  ///< needs supersampling and can hide balls
};

using Scene = std::vector<Body>;

Body steel(std::string name, std::vector<Solid> solids);
Body moved(Body body, const geometry::RigidTransform& a_from_b);

/// Signal behind the scene along a ray, relative to the open beam.
double transmission(const Scene& scene, const Eigen::Vector3d& source, const Eigen::Vector3d& direction);

}  // namespace helicarm::simulation
