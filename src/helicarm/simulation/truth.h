// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/c_arm.h"
#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

enum class Visibility {
  clear,    ///< its whole shadow lies in the image and touches no other metal
  hidden,   ///< partly covered by other metal
  outside,  ///< partly outside the image or the field, or under a shutter
  absent    ///< not present
};

/// True image of the centre of a small object in the stored image.
struct TruePoint {
  std::string name;
  Eigen::Vector3d in_calibrator;
  Eigen::Vector2d ideal;
  Eigen::Vector2d raw;
  Visibility visibility;
};

/// `scene` is the rendered scene; the object is its body called `name`, absent if there is none.
TruePoint true_point(const std::string& name, const Eigen::Vector3d& in_calibrator, double diameter_mm,
                     const Scene& scene, const TrueView& true_view);

}  // namespace helicarm::simulation
