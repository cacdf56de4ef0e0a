// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/tunnel_slices.h"

#include <gtest/gtest.h>

#include "helicarm/case_registration/bone_checks.h"
#include "helicarm/image/png.h"
#include "helicarm/phantom/mesh.h"

namespace helicarm::case_registration {
namespace tunnel_slices_test {

using Eigen::Vector3d;

/// A CT of 1 mm voxels: bone of 900 HU in |x| < 12, |y| < 20, |z| < 20, air around it.
volume::Volume block_of_bone() {
  volume::Volume ct;
  ct.size = {61, 61, 61};
  ct.patient_from_voxel.translation() = Vector3d::Constant(-30);
  ct.voxels.assign(61 * 61 * 61, -1000);
  for (int z = 0; z < 61; ++z)
    for (int y = 0; y < 61; ++y)
      for (int x = 0; x < 61; ++x)
        if (std::abs(x - 30) < 12 && std::abs(y - 30) < 20 && std::abs(z - 30) < 20)
          ct.voxels[std::size_t(x + 61 * (y + 61 * z))] = 900;
  return ct;
}

/// A tunnel of 6 mm along z at x = 6: its wall is 3 mm from the face at x = 12.
MarkupPlan plan() {
  MarkupPlan plan;
  plan.points = {{"T_start", {6, 0, -25}}, {"T_end", {6, 0, 25}}};
  plan.tunnels = {{"T", 0, 1, 6.0, 2.0}};
  return plan;
}

struct Sliced {
  std::optional<registration::BoneCheck> check;
  std::optional<TunnelSlices> slices;
};

Sliced sliced(bool with_ct) {
  const volume::Volume ct = block_of_bone();
  const auto bone = registration::bone_surface(ct, {}, registration::HuWindow{150, 3000});
  const auto checks = bone_checks(plan(), bone.get());
  return {checks.front(), tunnel_slices(plan(), checks, *bone, with_ct ? &ct : nullptr).front()};
}

TEST(TunnelSlices, ShowTheTunnelWhereItIs) {
  const Sliced of = sliced(true);
  ASSERT_TRUE(of.slices && of.check);
  const TunnelSlice& along = of.slices->slices[0];
  EXPECT_NEAR((along.end - along.start).norm() * of.slices->pixel_mm, 50, 1e-9);
  const TunnelSlice& across = of.slices->slices[2];
  EXPECT_LT((across.end - across.start).norm(), 1e-9);
  EXPECT_NEAR((across.thinnest - across.start).norm() * of.slices->pixel_mm, 3, 1e-6);
}

TEST(TunnelSlices, TheOutlineIsTheBonesSurface) {
  const Sliced of = sliced(true);
  const TunnelSlice& across = of.slices->slices[2];
  // From the axis the face between the voxels at x = 11 and 12 is 5.5 mm away, in the direction of the
  // thinnest place; in pixels of the slice.
  const Eigen::Vector2d outward = (across.thinnest - across.start).normalized();
  double nearest = 1e9;
  for (const auto& curve : across.outline)
    for (const Eigen::Vector2d& at : curve)
      if (std::abs((at - across.start).dot(Eigen::Vector2d(-outward.y(), outward.x()))) < 80)
        nearest = std::min(nearest, std::abs((at - across.start).dot(outward) * of.slices->pixel_mm - 5.5));
  EXPECT_LT(nearest, 0.6);
}

TEST(TunnelSlices, GreyIsTheCtOrTheInsideOfASurface) {
  const Sliced with = sliced(true), without = sliced(false);
  const auto at_axis = [](const Sliced& of) {
    const TunnelSlice& across = of.slices->slices[2];
    return int(across.grey(int(across.start.x()), int(across.start.y())));
  };
  EXPECT_NEAR(at_axis(with), 255 * (900 + 250) / 1500, 1);
  EXPECT_EQ(at_axis(without), 150);
  EXPECT_EQ(with.slices->slices[0].grey(0, 0), 0);  // air
}

TEST(TunnelSlices, AreDrawnInTheColourOfTheDecision) {
  const Sliced of = sliced(true);
  registration::BoneCheck thin = *of.check, breach = *of.check;
  thin.required_mm = 10;
  breach.bridge_mm = -1;
  ASSERT_TRUE(!of.check->is_thin() && thin.is_thin() && !thin.is_breach() && breach.is_breach());
  const std::string good = tunnel_slices_png(*of.slices, *of.check);
  EXPECT_TRUE(image::is_png(good));
  EXPECT_NE(good, tunnel_slices_png(*of.slices, thin));
  EXPECT_NE(good, tunnel_slices_png(*of.slices, breach));
  EXPECT_NE(tunnel_slices_png(*of.slices, thin), tunnel_slices_png(*of.slices, breach));
}

TEST(TunnelSlices, ATunnelWithoutABoneCheckHasNone) {
  const volume::Volume ct = block_of_bone();
  const auto bone = registration::bone_surface(ct, {}, registration::HuWindow{150, 3000});
  MarkupPlan short_plan = plan();
  short_plan.points[1].in_model = short_plan.points[0].in_model;
  EXPECT_FALSE(tunnel_slices(short_plan, bone_checks(short_plan, bone.get()), *bone, &ct).front());
}

}  // namespace tunnel_slices_test
}  // namespace helicarm::case_registration
