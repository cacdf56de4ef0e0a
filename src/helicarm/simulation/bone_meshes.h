// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/phantom/mesh.h"

namespace helicarm::simulation {

/// Surfaces of what moves together: the fibula goes with the tibia, and so does the patella on its tendon.
struct BoneMeshes {
  TriangleMesh femur;
  TriangleMesh tibia;
};

/// The outer surfaces of knee_body's bones in the knee's frame, mm, by marching with the given step.
BoneMeshes bone_meshes(double step_mm);

/// The same surfaces elsewhere.
BoneMeshes moved(const BoneMeshes& bones, const RigidTransform& a_from_knee);

}  // namespace helicarm::simulation
