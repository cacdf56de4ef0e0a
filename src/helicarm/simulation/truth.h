// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/c_arm.h"
#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

enum class Visibility {
  clear,    ///< its whole shadow lies in the image and no other metal touches it
  hidden,   ///< other metal covers a part of it
  outside,  ///< a part of it lies beyond the image, the field or under a shutter
  absent    ///< it is not there
};

/// Where the centre of a small thing is truly seen, in the stored image.
struct TruePoint {
  std::string name;
  Eigen::Vector3d in_calibrator;
  Eigen::Vector2d ideal;
  Eigen::Vector2d raw;
  Visibility visibility;
};

/// `scene` is what was rendered; the thing itself is its body called `name`, absent if there is none.
TruePoint true_point(const std::string& name, const Eigen::Vector3d& in_calibrator, double diameter_mm,
                     const Scene& scene, const TrueView& true_view);

}  // namespace helicarm::simulation
