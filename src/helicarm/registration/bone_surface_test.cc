// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/bone_surface.h"

#include <gmock/gmock.h>

#include "helicarm/phantom/mesh.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

/// How far a voxel is outside a cube of 20 mm whose walls at x are at 10 + `shift` from the middle.
double outside_cube(const volume::Volume& ct, const Eigen::Vector3i& voxel, double shift) {
  const Vector3d at = (ct.patient_from_voxel * voxel.cast<double>()).cwiseAbs() - Vector3d(shift, 0, 0);
  return at.maxCoeff() - 10;
}

/// Such a cube of bone with a shell of 3 mm about marrow; the CT's edges are `blur_mm` wide, the grid ends at
/// z = `top`.
volume::Volume shelled_cube(double shift, int top, double blur_mm = 1) {
  volume::Volume ct;
  ct.size = {40, 40, 20 + top};
  ct.patient_from_voxel = Eigen::Affine3d(Eigen::Translation3d(-20, -20, -20));
  for (int z = 0; z < ct.size.z(); ++z)
    for (int y = 0; y < ct.size.y(); ++y)
      for (int x = 0; x < ct.size.x(); ++x) {
        const double outside = outside_cube(ct, {x, y, z}, shift);
        const double share = std::clamp(0.5 - outside / blur_mm, 0.0, 1.0);
        ct.voxels.push_back(static_cast<float>(outside < -3.5 ? -80 : 50 + 900 * share));
      }
  return ct;
}

TEST(BoneSurface, MarrowBelowAWindowBelongsToTheBone) {
  const auto bone = bone_surface(shelled_cube(0.25, 20), std::nullopt, HuWindow{200, 3000});
  EXPECT_TRUE(bone->holds({0, 0, 0}));
  const auto found = bone->crossings({0, 0, 0}, {1, 0, 0}, 30);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].leaves);
  EXPECT_LT((found[0].normal - Vector3d(1, 0, 0)).norm(), 0.05);
}

TEST(BoneSurface, TheCtPlacesTheEdgeOfAGrownMask) {
  for (const double shift : {-0.3, 0.0, 0.3}) {
    const volume::Volume ct = shelled_cube(shift, 20);
    volume::Volume mask = ct;
    for (float& value : mask.voxels) value = value < 50.5F ? 0 : 1;  // every voxel that holds bone
    const auto bone = bone_surface(ct, mask, std::nullopt);
    const auto found = bone->crossings({0, 0, 0}, {1, 0, 0}, 30);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(found[0].at_mm, 10 + shift, 0.12);
  }
}

TEST(BoneSurface, AMaskThatIsGrownByAVoxelDoesNotThickenTheBone) {
  for (const double shift : {-0.3, 0.0, 0.3}) {
    const volume::Volume ct = shelled_cube(shift, 20, 1.6);
    volume::Volume mask = ct;
    std::size_t i = 0;
    for (int z = 0; z < ct.size.z(); ++z)
      for (int y = 0; y < ct.size.y(); ++y)
        for (int x = 0; x < ct.size.x(); ++x) mask.voxels[i++] = outside_cube(ct, {x, y, z}, shift) < 1.01;
    const auto found = bone_surface(ct, mask, std::nullopt)->crossings({0, 0, 0}, {1, 0, 0}, 30);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(found[0].at_mm, 10 + shift, 0.12);
  }
}

TEST(BoneSurface, ABoneThatIsCutOffHasNoSurfaceThere) {
  const auto bone = bone_surface(shelled_cube(0, 6), std::nullopt, HuWindow{200, 3000});
  EXPECT_TRUE(bone->holds({0, 0, 0}));
  EXPECT_TRUE(bone->crossings({0, 0, 0}, {0, 0, 1}, 40).empty());
  EXPECT_EQ(bone->crossings({0, 0, 0}, {0, 0, -1}, 40).size(), 1u);
}

TEST(BoneSurface, ABoneBesideTheVolumesFaceHasItsSurface) {
  for (const int top : {12, 13, 20}) {
    const auto bone = bone_surface(shelled_cube(0, top), std::nullopt, HuWindow{200, 3000});
    const auto found = bone->crossings({0, 0, 0}, {0, 0, 1}, 40);
    ASSERT_EQ(found.size(), 1u) << top;
    EXPECT_NEAR(found[0].at_mm, 10, 0.15) << top;
  }
}

TEST(BoneSurface, AShellInsideASurfaceIsACavity) {
  const auto ball = [](double radius) {
    return phantom::surface_of([radius](const Vector3d& p) { return p.norm() - radius; },
                               {Vector3d::Constant(-14), Vector3d::Constant(14)}, 1);
  };
  phantom::TriangleMesh mesh = ball(10);
  const phantom::TriangleMesh inner = ball(6);
  const auto first = std::uint32_t(mesh.corners.size());
  mesh.corners.insert(mesh.corners.end(), inner.corners.begin(), inner.corners.end());
  for (const auto& [a, b, c] : inner.triangles) mesh.triangles.push_back({first + a, first + c, first + b});
  const auto bone = bone_surface(*prepare_surface(mesh, "ball"), 0);
  EXPECT_TRUE(bone->holds({0, 0, 0}));
  const auto found = bone->crossings({-20, 0.1, 0.1}, {1, 0, 0}, 40);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_FALSE(found[0].leaves);
  EXPECT_NEAR(found[0].at_mm, 10, 0.1);
  EXPECT_NEAR(found[1].at_mm, 30, 0.1);
}

}  // namespace
}  // namespace helicarm::registration
