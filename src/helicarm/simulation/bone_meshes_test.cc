// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/bone_meshes.h"

#include <gtest/gtest.h>

#include "helicarm/simulation/knee.h"

namespace helicarm::simulation {
namespace {

/// Volume of the named body by ray casting on a fine grid along z.
double volume_by_rays(const std::string& name) {
  for (const Body& body : knee_body())
    if (body.name == name) {
      double sum = 0;
      for (double x = -200; x < 200; x += 0.5)
        for (double y = -60; y < 60; y += 0.5) sum += union_length(body.solids, {x, y, -500}, {0, 0, 1});
      return sum * 0.25;
    }
  return 0;
}

TEST(BoneMeshes, VolumesAgreeWithTheBones) {
  const BoneMeshes bones = bone_meshes(2);
  EXPECT_NEAR(phantom::volume(bones.femur) / volume_by_rays("femur"), 1, 0.01);
  const double below = volume_by_rays("tibia") + volume_by_rays("fibula") + volume_by_rays("patella");
  EXPECT_NEAR(phantom::volume(bones.tibia) / below, 1, 0.02);  // the fibula's head overlaps the tibia
}

TEST(BoneMeshes, CoarseMeshesAreSmall) {
  const BoneMeshes bones = bone_meshes(6);
  EXPECT_LT(bones.femur.triangles.size() + bones.tibia.triangles.size(), 20000u);
  EXPECT_GT(bones.femur.triangles.size(), 1000u);
}

TEST(BoneMeshes, MoveRigidly) {
  const BoneMeshes bones = bone_meshes(8);
  const geometry::RigidTransform motion{Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                                        {1, 2, 3}};
  const BoneMeshes there = moved(bones, motion);
  EXPECT_LT((there.femur.corners[7] - motion * bones.femur.corners[7]).norm(), 1e-12);
  EXPECT_EQ(there.tibia.triangles, bones.tibia.triangles);
}

}  // namespace
}  // namespace helicarm::simulation
