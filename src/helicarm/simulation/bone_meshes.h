// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/phantom/mesh.h"

namespace helicarm::simulation {

/// Surfaces of rigid groups: fibula and patella (on its tendon) move with the tibia.
struct BoneMeshes {
  phantom::TriangleMesh femur;
  phantom::TriangleMesh tibia;
};

/// Outer surfaces of knee_body's bones in the knee's frame, mm, by marching with the given step.
BoneMeshes bone_meshes(double step_mm);

/// The surfaces in another frame.
BoneMeshes moved(const BoneMeshes& bones, const geometry::RigidTransform& a_from_knee);

}  // namespace helicarm::simulation
