// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/find_target.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/fiducials/solid_template.h"
#include "helicarm/rectification/simulated_image_test.h"
#include "helicarm/simulation/detector_response.h"
#include "helicarm/simulation/render_view.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using simulation::SimulatedCase;
using simulation::SimulatedView;
using simulation::Visibility;

/// A flat panel (rectified, ideal and raw pixels are equal); the lateral view is mirrored.
const SimulatedCase& simulated_case() {
  static const SimulatedCase simulated =
      rectification::small_case(9, simulation::CaseKind::flat, {simulation::Fault::mirrored});
  return simulated;
}

rectification::DistortionMap no_distortion() { return rectification::identity_map(512, 512, {}); }

/// One target of each kind in soft tissue of varying thickness, in an image of 256 x 256 pixels.
struct TargetImage {
  geometry::View view{{3300, 3300, 127, 126}, {Eigen::Matrix3d::Identity(), {0, 0, 640}}};
  std::vector<phantom::CalibratorTarget> targets = {
      {"ball", {-12.3, -10.1, 3}, phantom::TargetKind::ball, 3, {}, 0},
      {"cross",
       {9.7, -8.2, -4},
       phantom::TargetKind::cross,
       2,
       {Vector3d(0.8, 0.6, 0), Vector3d(-0.6, 0.8, 0)},
       16},
      {"end", {-9.2, 11.4, 5}, phantom::TargetKind::line_end, 2, {Vector3d(0.96, 0.28, 0)}, 20}};
  xray::XrayImage xray_image;

  explicit TargetImage(bool mirrored) {
    const simulation::Body tissue{
        "tissue", {simulation::ellipsoid({25, 10, 0}, {90, 70, 40})}, simulation::material::muscle};
    const auto wire = [&](std::size_t k, const Vector3d& axis, double from, double to) {
      const Vector3d& at = targets[k].point_in_calibrator;
      return simulation::cylinder(at + from * axis, at + to * axis, 1);
    };
    const simulation::Scene scene = {
        tissue, simulation::steel("ball", {simulation::sphere(targets[0].point_in_calibrator, 1.5)}),
        simulation::steel(
            "cross", {wire(1, targets[1].directions[0], -8, 8), wire(1, targets[1].directions[1], -8, 8)}),
        simulation::steel("end", {wire(2, targets[2].directions[0], 0, 20)})};
    simulation::VirtualDetector detector;
    detector.width = detector.height = 256;
    auto pixels = simulation::detector_response(simulation::render_view(scene, detector, view), {}, 1, 1);
    if (mirrored) {
      pixels = simulation::mirrored(pixels);
      view.intrinsics.fx = -view.intrinsics.fx;
      view.intrinsics.u0 = 255 - view.intrinsics.u0;
    }
    xray_image.pixels = image::Image<float>(256, 256);
    std::copy(pixels.pixels().begin(), pixels.pixels().end(), xray_image.pixels.pixels().begin());
  }
};

/// With a view that is 1.5 px off, as after a calibration.
void expect_found(std::size_t k) {
  for (const bool mirrored : {false, true}) {
    const TargetImage target_image(mirrored);
    geometry::View off = target_image.view;
    off.intrinsics.u0 += 1.3;
    off.intrinsics.v0 -= 0.8;
    const auto found =
        find_target(target_image.xray_image, rectification::identity_map(256, 256, {}), off,
                    target_image.targets[k], {}, detection::noise_correlation(target_image.xray_image));
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_LT((found->uv - target_image.view.project(target_image.targets[k].point_in_calibrator)).norm(),
              0.1)
        << mirrored;
    EXPECT_EQ(found->uv, found->uv_raw);
    EXPECT_LT(found->sigma_px, 0.1);
  }
}

TEST(FindTarget, BallWithinATenthOfAPixel) { expect_found(0); }
TEST(FindTarget, CrossWithinATenthOfAPixel) { expect_found(1); }
TEST(FindTarget, LineEndWithinATenthOfAPixel) { expect_found(2); }

TEST(FindTarget, BallOfAFileWhoseScaleIsWrongWithinATenthOfAPixel) {
  for (const double factor : {0.88, 1.13}) {
    const TargetImage scene(false);
    phantom::CalibratorTarget target = scene.targets[0];
    target.diameter_mm *= factor;
    const auto found = find_target(scene.xray_image, rectification::identity_map(256, 256, {}), scene.view,
                                   target, {}, detection::noise_correlation(scene.xray_image));
    ASSERT_TRUE(found) << factor << ": " << found.error().message;
    EXPECT_LT((found->uv - scene.view.project(target.point_in_calibrator)).norm(), 0.1) << factor;
    EXPECT_LT(found->sigma_px, 0.1) << factor;
  }
}

TEST(FindTarget, CrossOnTheCalibratorWithinATenthOfAPixel) {
  for (const SimulatedView& view : simulated_case().views)
    for (const std::size_t k : {1u, 2u}) {
      if (view.targets[k].visibility != Visibility::clear) continue;
      const auto found = find_target(exposure_of(view), no_distortion(), view.true_view.stored_view(),
                                     simulated_case().calibrator.targets[k], {},
                                     detection::noise_correlation(exposure_of(view)));
      ASSERT_TRUE(found) << found.error().message;
      EXPECT_LT((found->uv - view.targets[k].ideal).norm(), 0.1)
          << view.true_view.name << " " << view.targets[k].name;
    }
}

TEST(FindTarget, AbsentTargetIsNotFound) {
  phantom::CalibratorTarget absent = simulated_case().calibrator.targets[0];
  absent.point_in_calibrator += Vector3d(14, 5, -20);
  const auto found = find_target(exposure_of(simulated_case().views[0]), no_distortion(),
                                 simulated_case().views[0].true_view.stored_view(), absent, {}, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::target_not_found);
}

TEST(FindTarget, TargetOutsideTheImageIsNotSeen) {
  phantom::CalibratorTarget outside = simulated_case().calibrator.targets[0];
  outside.point_in_calibrator += Vector3d(0, 400, 0);
  const auto found = find_target(exposure_of(simulated_case().views[0]), no_distortion(),
                                 simulated_case().views[0].true_view.stored_view(), outside, {}, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::not_seen);
}

TEST(FindTarget, TargetBehindTheSourceIsRefused) {
  const geometry::View view = simulated_case().views[0].true_view.stored_view();
  phantom::CalibratorTarget behind = simulated_case().calibrator.targets[0];
  behind.point_in_calibrator = view.camera_from_world.inverse() * Vector3d(0, 0, -50);
  const auto found =
      find_target(exposure_of(simulated_case().views[0]), no_distortion(), view, behind, {}, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::behind_source);
}

TEST(SnapToBall, ClickBesideABallGivesItsCentresImage) {
  for (const SimulatedView& view : simulated_case().views) {
    const geometry::View stored = view.true_view.stored_view();
    for (const auto& ball : view.balls) {
      if (ball.visibility != Visibility::clear) continue;
      const auto found =
          snap_to_ball(exposure_of(view), no_distortion(), stored, stored.depth(ball.in_calibrator),
                       ball.raw + Vector2d(2.1, -1.6), 4, detection::noise_correlation(exposure_of(view)));
      ASSERT_TRUE(found) << view.true_view.name << " " << ball.name;
      EXPECT_LT((found->uv - ball.ideal).norm(), 0.15) << view.true_view.name << " " << ball.name;
    }
  }
}

TEST(SnapToBall, NoBallNearTheClickIsNotFound) {
  const SimulatedView& view = simulated_case().views[0];
  const auto found =
      snap_to_ball(exposure_of(view), no_distortion(), view.true_view.stored_view(), 640, {20, 20}, 4, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::target_not_found);
}

phantom::CalibratorTarget target_of(phantom::TargetKind kind) {
  return {"T", {1, 2, 3}, kind, 2, {Vector3d::UnitX(), Vector3d::UnitY()}, 16};
}

TEST(PointOfClick, ClickOutsideTheImageIsNotSeen) {
  const rectification::DistortionMap map = rectification::identity_map(640, 480, std::nullopt);
  EXPECT_TRUE(point_of_click(map, {600, 470}, 0.5));
  for (const Eigen::Vector2d& outside : {Eigen::Vector2d(-50, 3), Eigen::Vector2d(470, 600)}) {
    const auto seen = point_of_click(map, outside, 0.5);
    ASSERT_FALSE(seen);
    EXPECT_EQ(seen.error().reason, Reason::not_seen);
    EXPECT_EQ(seen.error().figures.at("u"), outside.x());
  }
}

TEST(PathInTarget, BallsDiameterAndChord) {
  const phantom::CalibratorTarget ball = target_of(phantom::TargetKind::ball);
  EXPECT_NEAR(path_in_target(ball, {1, 2, -90}, Vector3d::UnitZ()), 2, 1e-12);
  EXPECT_NEAR(path_in_target(ball, {1.6, 2, -90}, Vector3d::UnitZ()), 1.6, 1e-12);
  EXPECT_EQ(path_in_target(ball, {2.1, 2, -90}, Vector3d::UnitZ()), 0);
}

TEST(PathInTarget, CrossCountsTheSharedMetalOnce) {
  const phantom::CalibratorTarget cross = target_of(phantom::TargetKind::cross);
  EXPECT_NEAR(path_in_target(cross, {1, 2, -90}, Vector3d::UnitZ()), 2, 1e-12);
  EXPECT_NEAR(path_in_target(cross, {6, 2, -90}, Vector3d::UnitZ()), 2, 1e-12);
  EXPECT_EQ(path_in_target(cross, {9.1, 2, -90}, Vector3d::UnitZ()), 0);
  EXPECT_NEAR(path_in_target(cross, {-90, 2, 3}, Vector3d::UnitX()), 16, 1e-12);
}

TEST(PathInTarget, LineEndsFlatAtItsPoint) {
  const phantom::CalibratorTarget end = target_of(phantom::TargetKind::line_end);
  EXPECT_NEAR(path_in_target(end, {1.01, 2, -90}, Vector3d::UnitZ()), 2, 1e-12);
  EXPECT_EQ(path_in_target(end, {0.99, 2, -90}, Vector3d::UnitZ()), 0);
  EXPECT_EQ(path_in_target(end, {17.01, 2, -90}, Vector3d::UnitZ()), 0);
}

TEST(SolidTemplate, SlopeMatchesFiniteDifferences) {
  const geometry::View view{{1500, 1500, 100, 100}, {Eigen::Matrix3d::Identity(), {0, 0, 640}}};
  const SolidTemplate absorbed(image_of_target(target_of(phantom::TargetKind::cross), view, 20), 0.5, 1);
  const double h = 0.01;
  for (double x = -9.13; x < 9; x += 1.7)
    for (double y = -9.13; y < 9; y += 1.7)
      for (int axis = 0; axis < 2; ++axis) {
        const Vector2d step = h * Vector2d::Unit(axis);
        const double numeric =
            (absorbed.at(Vector2d(x, y) + step).value - absorbed.at(Vector2d(x, y) - step).value) / (2 * h);
        EXPECT_NEAR(absorbed.at({x, y}).slope[axis], numeric, 1e-4);
      }
}

TEST(SolidTemplate, IsZeroOutsideItsImage) {
  const geometry::View view{{1500, 1500, 100, 100}, {Eigen::Matrix3d::Identity(), {0, 0, 640}}};
  EXPECT_EQ(SolidTemplate(image_of_target(target_of(phantom::TargetKind::cross), view, 20), 0.5, 1)
                .at({90, 0})
                .value,
            0);
}

}  // namespace
}  // namespace helicarm::fiducials
