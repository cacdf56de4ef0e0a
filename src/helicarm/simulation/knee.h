// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

/// A slightly flexed knee of ellipsoids and cones with dense shells. Its frame: origin in the middle of the
/// joint line, x distal, y lateral, z anterior (mm).
Scene knee_body();

/// An ACL tunnel: its joint end and its far end in the knee's frame.
struct KneeTunnel {
  Eigen::Vector3d start;
  Eigen::Vector3d end;
};

KneeTunnel femoral_tunnel();
KneeTunnel tibial_tunnel();

}  // namespace helicarm::simulation
