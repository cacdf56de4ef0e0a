// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/render_view.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/phantom/plate.h"
#include "helicarm/simulation/c_arm.h"
#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/knee.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double f_mm = 1000;
constexpr double depth_mm = 650;

/// Small receiver, looking along z from the origin; the scene's centre is 650 mm away.
VirtualDetector small_detector() {
  VirtualDetector detector;
  detector.width = 128;
  detector.height = 96;
  detector.pixel_mm = 0.2;
  return detector;
}

geometry::View straight_view(const VirtualDetector& detector) {
  const double f_px = f_mm / detector.pixel_mm;
  return {{f_px, f_px, 63.3, 47.6}, {Eigen::Matrix3d::Identity(), {0, 0, depth_mm}}};
}

/// Equal attenuation at all three lines, so that the logarithm of the signal is the path length.
Body grey(Solid solid, double per_mm, bool metal = false) {
  return {"grey", {std::move(solid)}, Attenuation::Constant(per_mm), metal};
}

double path(const image::Image<float>& image, int u, int v, double per_mm) {
  return -std::log(image(u, v)) / per_mm;
}

TEST(RenderView, EmptySceneIsTheOpenBeam) {
  const VirtualDetector detector = small_detector();
  const image::Image<float> image = render_view({}, detector, straight_view(detector), 1);
  for (float pixel : image.pixels()) EXPECT_FLOAT_EQ(pixel, 1);
}

TEST(RenderView, BallChordFollowsTheClosedFormFromCentreToEdge) {
  const VirtualDetector detector = small_detector();
  const geometry::View view = straight_view(detector);
  const image::Image<float> image = render_view({grey(sphere({0, 0, 0}, 5), 0.02)}, detector, view, 1);
  for (int u = 0; u < detector.width; ++u) {
    const Vector3d ray((u - view.intrinsics.u0) / view.intrinsics.fx,
                       (48 - view.intrinsics.v0) / view.intrinsics.fy, 1);
    const double miss = Vector3d(0, 0, depth_mm).cross(ray).norm() / ray.norm();
    EXPECT_NEAR(path(image, u, 48, 0.02), 2 * std::sqrt(std::max(0.0, 25 - miss * miss)), 1e-4);
  }
}

TEST(RenderView, AbsorbedMassOfABallIsItsVolume) {
  const VirtualDetector detector = small_detector();
  const geometry::View view = straight_view(detector);
  constexpr double radius = 4;
  const image::Image<float> image =
      render_view({grey(sphere({0, 0, 0}, radius), 0.05, true)}, detector, view, 1);
  double sum = 0;
  for (int v = 0; v < detector.height; ++v)
    for (int u = 0; u < detector.width; ++u) sum += path(image, u, v, 0.05);
  const double magnification = f_mm / depth_mm;
  const double volume = sum * std::pow(detector.pixel_mm / magnification, 2);
  EXPECT_NEAR(volume / (4.0 / 3.0 * EIGEN_PI * std::pow(radius, 3)), 1, 1e-3);
}

TEST(RenderView, SteelBallCentroidIsTheCentreOfItsProjectedEllipse) {
  VirtualDetector detector = small_detector();
  geometry::View view = straight_view(detector);
  view.intrinsics.u0 = -400;  // the ball is 5 degrees off the axis
  constexpr double radius = 2;
  const Vector3d centre((63.4 + 400) / view.intrinsics.fx * depth_mm, 0.31, 0);
  const image::Image<float> image = render_view({grey(sphere(centre, radius), 3, true)}, detector, view, 1);
  // The outline is the conic K (c c' - (c.c - r^2) I) K'; its centre follows from the last column of its
  // dual.
  const Vector3d c = view.camera_from_world * centre;
  const Eigen::Matrix3d k = view.intrinsics.matrix();
  const Eigen::Matrix3d dual =
      k * (c * c.transpose() - radius * radius * Eigen::Matrix3d::Identity()) * k.transpose();
  const Vector2d ellipse = dual.col(2).head<2>() / dual(2, 2);
  Vector2d sum(0, 0);
  double weight = 0;
  for (int v = 0; v < detector.height; ++v)
    for (int u = 0; u < detector.width; ++u) {
      const double dark = 1 - image(u, v);
      sum += dark * Vector2d(u, v);
      weight += dark;
    }
  EXPECT_LT((sum / weight - ellipse).norm(), 0.005);
}

TEST(RenderView, DistortionMovesTheBallByItsInverse) {
  VirtualDetector detector = small_detector();
  detector.distortion.centre_px = {60, 50};
  detector.distortion.radius_px = 64;
  detector.distortion.k1 = -0.03;
  detector.distortion.shift_px = {4, -3};
  const geometry::View view = straight_view(detector);
  const Vector3d centre(2.1, -1.3, 0);
  const image::Image<float> image = render_view({grey(sphere(centre, 1), 3, true)}, detector, view, 1);
  Vector2d sum(0, 0);
  double weight = 0;
  for (int v = 0; v < detector.height; ++v)
    for (int u = 0; u < detector.width; ++u) {
      sum += (1 - image(u, v)) * Vector2d(u, v);
      weight += 1 - image(u, v);
    }
  EXPECT_LT((sum / weight - detector.distortion.raw_from_ideal(view.project(centre))).norm(), 0.1);
}

TEST(RenderView, NestedShellIsTheDifferenceOfItsTwoChords) {
  const VirtualDetector detector = small_detector();
  const Scene shell = {grey(sphere({0, 0, 0}, 6), 0.05), grey(sphere({0, 0, 0}, 5), -0.05)};
  const geometry::View view = straight_view(detector);
  EXPECT_NEAR(transmission(shell, view.source_in_world(), {0, 0, 1}), std::exp(-0.05 * 2), 1e-12);
  EXPECT_NEAR(render_view(shell, detector, view, 1)(63, 48), std::exp(-0.05 * 2), 1e-4);
}

TEST(RenderView, RoundFieldIsBlackOutsideAndUnchangedInside) {
  VirtualDetector detector = small_detector();
  detector.distortion.centre_px = {64, 48};
  detector.field_radius_px = 40;
  const image::Image<float> image = render_view({}, detector, straight_view(detector), 1);
  EXPECT_EQ(image(64 + 42, 48), 0);
  EXPECT_EQ(image(0, 0), 0);
  EXPECT_EQ(image(64 + 38, 48), 1);
  double area = 0;
  for (float pixel : image.pixels()) area += pixel;
  EXPECT_NEAR(area, EIGEN_PI * 40 * 40, 10);
}

/// Reference: every ray through every body.
image::Image<float> render_by_brute_force(const Scene& scene, const VirtualDetector& detector,
                                          const geometry::View& view) {
  const Vector3d source = view.source_in_world();
  const auto ray = [&](double u, double v) -> Vector3d {
    const Vector2d ideal = detector.distortion.ideal_from_raw({u, v});
    const Vector3d in_camera = view.intrinsics.matrix().inverse() * Vector3d(ideal.x(), ideal.y(), 1);
    return view.camera_from_world.rotation.transpose() * in_camera.normalized();
  };
  const auto signal = [&](double u, double v) {
    return field_weight(detector, {u, v}) * transmission(scene, source, ray(u, v));
  };
  const auto metal = [&](int u, int v) {
    double path = 0;
    for (const Body& body : scene)
      if (body.metal) path += union_length(body.solids, source, ray(u, v));
    return path;
  };
  image::Image<float> paths(detector.width, detector.height);
  for (int v = 0; v < detector.height; ++v)
    for (int u = 0; u < detector.width; ++u) paths(u, v) = static_cast<float>(metal(u, v));
  image::Image<float> image(detector.width, detector.height);
  for (int v = 0; v < detector.height; ++v)
    for (int u = 0; u < detector.width; ++u) {
      bool edge = false;
      for (int row = std::max(v - 1, 0); row <= std::min(v + 1, detector.height - 1); ++row)
        for (int column = std::max(u - 1, 0); column <= std::min(u + 1, detector.width - 1); ++column)
          edge = edge || std::abs(paths(column, row) - paths(u, v)) > 0.05f;
      double sum = edge ? 0 : 9 * signal(u, v);
      for (int row = -1; edge && row <= 1; ++row)
        for (int column = -1; column <= 1; ++column) sum += signal(u + column / 3.0, v + row / 3.0);
      image(u, v) = static_cast<float>(sum / 9);
    }
  return image;
}

TEST(RenderView, SceneAgreesWithBruteForceRayCasting) {
  SimulationOptions options;
  options.size = 256;
  for (const Preset preset : {Preset::ii_9in, Preset::flat_panel}) {
    options.preset = preset;
    const TrueView true_view = take_stand(options, 15, {}).back();
    phantom::Calibrator calibrator = phantom::udcsc();
    calibrator.targets = check_targets(calibrator);
    Scene scene = calibrator_body(calibrator);
    const geometry::RigidTransform aside{Eigen::Matrix3d::Identity(), {12, 5, 20}};
    for (const Body& body : knee_body()) scene.push_back(moved(body, aside));
    for (const Body& dot : plate_body(phantom::plate48(), true_view.camera_from_plate, true_view.view))
      scene.push_back(dot);
    const image::Image<float> image = render_view(scene, true_view.detector, true_view.view, 2);
    const image::Image<float> truth = render_by_brute_force(scene, true_view.detector, true_view.view);
    for (int v = 0; v < image.height(); ++v)
      for (int u = 0; u < image.width(); ++u) ASSERT_NEAR(image(u, v), truth(u, v), 1e-6) << u << ' ' << v;
  }
}

TEST(RenderView, ResultIsIndependentOfTheNumberOfThreads) {
  VirtualDetector detector = small_detector();
  const Scene scene = {steel("ball", {sphere({1, 2, 3}, 2)}),
                       grey(cylinder({-20, 3, 1}, {20, -4, 9}, 6), 0.03)};
  const geometry::View view = straight_view(detector);
  const image::Image<float> one = render_view(scene, detector, view, 1);
  const image::Image<float> two = render_view(scene, detector, view, 2);
  EXPECT_TRUE(std::equal(one.pixels().begin(), one.pixels().end(), two.pixels().begin()));
}

}  // namespace
}  // namespace helicarm::simulation
