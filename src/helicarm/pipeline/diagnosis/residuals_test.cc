// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/residuals.h"

#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/pipeline/prior.h"

namespace helicarm::pipeline {
namespace {

using Kind = ImageChange::Kind;

constexpr double pixel_mm = 0.29;
constexpr double sigma_px = 0.05;
const Eigen::Vector2d size_px(1024, 1024);
const Eigen::Vector2d centre = (size_px - Eigen::Vector2d::Ones()) / 2;

/// Two flat-panel views of the paper's helix of twelve balls.
std::vector<calibration::ViewFiducials> helix_views(std::uint64_t seed) {
  std::vector<calibration::ViewFiducials> views;
  RandomStream random(seed, 0);
  for (const double alpha : {0.0, std::numbers::pi / 2}) {
    const Eigen::Matrix3d rotation = geometry::rotation_from_euler(alpha, 0.03, 0.02);
    const geometry::View view{{1015 / pixel_mm, 1015 / pixel_mm, centre.x() + 10, centre.y() - 15, 0},
                              {rotation, Eigen::Vector3d(3, -2, 700) - rotation * Eigen::Vector3d(0, 0, 45)}};
    calibration::ViewFiducials seen{alpha == 0 ? "AP" : "LAT", {}};
    seen.prior = {1020 / pixel_mm, centre, 1 / pixel_mm, geometry::NormalPrior{1, 0.001}};
    seen.start = view;
    for (int k = 0; k < 12; ++k) {
      const double t = std::numbers::pi / 6 + k * std::numbers::pi / 2, radius = 60 * std::exp(-t / 31.529);
      fiducials::Fiducial ball{fmt::format("P{}", k + 1),
                               {radius * std::cos(t), radius * std::sin(t), 5 * t}};
      ball.status = fiducials::FiducialStatus::used;
      ball.sigma_px = sigma_px;
      ball.uv = view.project(ball.centre_in_calibrator) +
                sigma_px * Eigen::Vector2d(random.normal(), random.normal());
      seen.fiducials.push_back(ball);
    }
    views.push_back(seen);
  }
  return views;
}

std::optional<ImageChange> change_of(const std::vector<calibration::ViewFiducials>& views) {
  return best_image_change(views, {size_px, size_px}, {unknown_c_arm()});
}

void distort(calibration::ViewFiducials& view,
             double share) {  // inverse of the radial change, to first order
  for (fiducials::Fiducial& ball : view.fiducials) {
    const Eigen::Vector2d from = ball.uv - centre;
    ball.uv = centre + from * (1 - share * from.squaredNorm() / (512.0 * 512.0));
  }
}

TEST(ImageChange, UntouchedImagesHaveNone) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) EXPECT_FALSE(change_of(helix_views(seed))) << seed;
}

TEST(ImageChange, RadialDistortionIsFound) {
  for (const double share : {0.01, -0.01, 0.02}) {
    auto views = helix_views(3);
    for (calibration::ViewFiducials& view : views) distort(view, share);
    const auto change = change_of(views);
    ASSERT_TRUE(change) << share;
    EXPECT_EQ(change->kind, Kind::radial);
    EXPECT_NEAR(change->amount, share, 0.2 * std::abs(share));
  }
}

TEST(ImageChange, ScaleOfOneViewIsFound) {
  for (const double scale : {1.03, 0.97}) {
    auto views = helix_views(4);
    for (fiducials::Fiducial& ball : views[1].fiducials) ball.uv = centre + scale * (ball.uv - centre);
    const auto change = change_of(views);
    ASSERT_TRUE(change) << scale;
    EXPECT_EQ(change->kind, Kind::scale);
    EXPECT_EQ(change->amount > 0, (scale > 1) == (*change->view == 1));
  }
}

TEST(ImageChange, WrongSourceDistanceOfAllViewsIsOneOfAll) {
  for (const double factor : {0.9, 1.1}) {
    auto views = helix_views(4);
    for (calibration::ViewFiducials& view : views) *view.prior.focal_px *= factor;
    const auto change = change_of(views);
    ASSERT_TRUE(change) << factor;
    EXPECT_EQ(change->kind, Kind::scale);
    EXPECT_FALSE(change->view) << factor;
    EXPECT_NEAR((1 + change->amount) * factor, 1, 0.02);
  }
}

TEST(ImageChange, RowsFartherApartAreFound) {
  auto views = helix_views(5);
  for (calibration::ViewFiducials& view : views)
    for (fiducials::Fiducial& ball : view.fiducials)
      ball.uv.y() = centre.y() + 1.02 * (ball.uv.y() - centre.y());
  const auto change = change_of(views);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->kind, Kind::aspect);
  EXPECT_NEAR(change->amount, 0.02, 0.004);
}

TEST(ImageChange, OneFalseFiducialIsNotAChange) {
  for (const double off : {2.0, 10.0}) {
    auto views = helix_views(6);
    views[0].fiducials[4].uv.x() += off;
    EXPECT_FALSE(change_of(views)) << off;
  }
}

}  // namespace
}  // namespace helicarm::pipeline
