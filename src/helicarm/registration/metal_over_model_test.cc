// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/metal_over_model.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace metal_test {

using Eigen::Vector2d;

constexpr double px_per_mm = 2;  // in the middle of the scene's images

/// The lopsided bone in one logarithmic view, with metal in front of it.
struct Scene {
  Model model = *model_from("bone", lopsided_bone(), std::nullopt, HuWindow{150, 3000});
  RegistrationView view = image_of(lopsided_bone(), true_pose(), view_from(0), "AP", 1);
  RegisteredView registered;
  Registration found;

  Scene() {
    view.logarithmic = true;
    for (float& grey : view.grey.pixels()) grey = 4000 + 400 * std::log((grey + 1) / 4096);
    found.world_from_model = true_pose();
    found.centre = true_pose() * model.centre;
    registered.comparison_px = 16;
    for (int v = 40; v < 120; v += 16)
      for (int u = 40; u < 120; u += 16) registered.agreements.push_back({Vector2d(u, v), 0.7, 1});
  }

  /// Metal where `inside` (mm from the image's middle); `attenuation`: of the logarithm of the dose.
  template <class Inside>
  void add(const Inside& inside, float attenuation = 4) {
    for (int v = 0; v < 160; ++v)
      for (int u = 0; u < 160; ++u)
        if (inside((u - 79.5) / px_per_mm, (v - 79.5) / px_per_mm)) view.grey(u, v) -= 400 * attenuation;
  }
  auto metal() const { return metal_over_model(model, view, registered, found); }
};

bool is_in_plate(double x, double y) { return std::abs(x) < 4 && std::abs(y) < 14; }

TEST(MetalOverModel, APlateIsNamedWithItsLength) {
  Scene scene;
  scene.add(is_in_plate);
  const auto metal = scene.metal();
  ASSERT_TRUE(metal);
  EXPECT_NEAR(metal->length_mm, 28, 3);
  EXPECT_NEAR(metal->area_mm2, 8 * 28, 60);
  EXPECT_GT(metal->contrast, 1.5);
}

TEST(MetalOverModel, TheAgreementBesideItIsSetApart) {
  Scene scene;
  scene.add(is_in_plate);
  for (LocalAgreement& each : scene.registered.agreements)
    if (std::abs(each.pixel.x() - 79.5) < 8) each.agreement = 0.1;
  const auto metal = scene.metal();
  ASSERT_TRUE(metal);
  EXPECT_LT(metal->agreement, metal->agreement_elsewhere - 0.1);
}

TEST(MetalOverModel, ABoneWithoutMetalHasNone) { EXPECT_FALSE(Scene().metal()); }

TEST(MetalOverModel, FiducialsAreNotNamed) {
  Scene scene;
  for (const double y : {-18.0, 0.0, 18.0})
    scene.add([&](double x, double at) { return std::hypot(x, at - y) < 4; });
  EXPECT_FALSE(scene.metal());
}

TEST(MetalOverModel, AScrewIsNamedAWireNot) {
  Scene screw, wire;
  screw.add([](double x, double y) { return std::abs(x) < 2 && std::abs(y) < 17.5; });
  wire.add([](double x, double y) { return std::abs(x) < 1 && std::abs(y) < 21; });
  const auto metal = screw.metal();
  ASSERT_TRUE(metal);
  EXPECT_NEAR(metal->area_mm2, 4 * 35, 12);
  EXPECT_FALSE(wire.metal());
}

TEST(MetalOverModel, MetalBesideTheModelIsNotNamed) {
  Scene scene;
  scene.add([](double x, double) { return x < -34; });
  EXPECT_FALSE(scene.metal());
}

TEST(MetalOverModel, WhatAttenuatesAsBoneIsNotNamed) {
  Scene scene;
  scene.add(is_in_plate, 0.2F);
  EXPECT_FALSE(scene.metal());
}

TEST(MetalOverModel, ASurfaceMayBeMetalItself) {
  Scene scene;
  scene.add(is_in_plate);
  scene.model = *model_from("implant", lopsided_surface());
  scene.found.centre = scene.found.world_from_model * scene.model.centre;
  EXPECT_FALSE(scene.metal());
}

}  // namespace metal_test
}  // namespace helicarm::registration
