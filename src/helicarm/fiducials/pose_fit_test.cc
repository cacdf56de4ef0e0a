// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/pose_fit.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::fiducials {
namespace {

const CameraPrior prior{4345, 0.01, {511.5, 511.5}, 30};

geometry::View truth() {
  geometry::View view{{4360, 4360, 530, 500}, {}};
  view.camera_from_world.rotation = Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, -1).normalized()).matrix();
  view.camera_from_world.translation = {5, -8, 640};
  return view;
}

std::vector<WeightedCorrespondence> correspondences(int n, double sigma_px) {
  RandomStream random(5, 0);
  std::vector<WeightedCorrespondence> all;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d point(random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-50, 50));
    const Eigen::Vector2d noise(random.normal(), random.normal());
    all.push_back({point, truth().project(point) + sigma_px * noise, sigma_px});
  }
  return all;
}

geometry::View nudged(geometry::View view) {
  view.camera_from_world.rotation =
      Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).matrix() * view.camera_from_world.rotation;
  view.camera_from_world.translation += Eigen::Vector3d(3, 3, -20);
  view.intrinsics.fx = std::copysign(4345, view.intrinsics.fx);
  view.intrinsics.fy = 4345;
  return view;
}

TEST(FitPose, ResidualsFallToTheNoise) {
  const auto fit = fit_pose(nudged(truth()), correspondences(12, 0.1), prior, 30);
  EXPECT_LT(fit.chi2, 40);
  EXPECT_LT((fit.view.project({10, 20, 30}) - truth().project({10, 20, 30})).norm(), 0.2);
}

TEST(FitPose, KeepsTheMirroring) {
  auto seen = correspondences(12, 0.1);
  for (auto& s : seen) s.uv.x() = 2 * truth().intrinsics.u0 - s.uv.x();
  geometry::View start = nudged(truth());
  start.intrinsics.fx = -start.intrinsics.fx;
  const auto fit = fit_pose(start, seen, prior, 30);
  EXPECT_LT(fit.chi2, 40);
  EXPECT_LT(fit.view.intrinsics.fx, 0);
  EXPECT_GT(fit.view.intrinsics.fy, 0);
}

TEST(FitPose, GradientVanishesAtTheFit) {
  // chi2 rises in every direction of the pose: a test without derivatives.
  const auto seen = correspondences(9, 0.5);
  const auto fit = fit_pose(nudged(truth()), seen, prior, 50);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double direction : {-1.0, 1.0}) {
      geometry::View turned = fit.view;
      turned.camera_from_world.rotation =
          Eigen::AngleAxisd(direction * 1e-3, Eigen::Vector3d::Unit(axis)).matrix() *
          turned.camera_from_world.rotation;
      EXPECT_GT(fit_pose(turned, seen, prior, 0).chi2, fit.chi2);
      geometry::View shifted = fit.view;
      shifted.camera_from_world.translation += direction * 0.2 * Eigen::Vector3d::Unit(axis);
      EXPECT_GT(fit_pose(shifted, seen, prior, 0).chi2, fit.chi2);
    }
  }
}

TEST(PredictionCovariance, EqualsTheScatterOfSimulatedFits) {
  // Reference: the scatter over 2000 fits.
  const Eigen::Vector3d elsewhere(40, -60, 10);
  const auto seen = correspondences(8, 0.5);
  const PoseFit fit = fit_pose(truth(), seen, prior, 20);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  constexpr int fits = 2000;
  for (int trial = 0; trial < fits; ++trial) {
    RandomStream random(6, 0, trial);
    CameraPrior drawn = prior;
    drawn.focal_px *= std::exp(prior.focal_sigma * random.normal());
    drawn.principal_px += prior.principal_sigma_px * Eigen::Vector2d(random.normal(), random.normal());
    auto noisy = seen;
    for (auto& s : noisy)
      s.uv = fit.view.project(s.point) + 0.5 * Eigen::Vector2d(random.normal(), random.normal());
    const Eigen::Vector2d off =
        fit_pose(fit.view, noisy, drawn, 20).view.project(elsewhere) - fit.view.project(elsewhere);
    scatter += off * off.transpose() / fits;
  }
  const Eigen::Matrix2d predicted = prediction_covariance(fit, elsewhere);
  EXPECT_NEAR(scatter(0, 0) / predicted(0, 0), 1, 0.15);
  EXPECT_NEAR(scatter(1, 1) / predicted(1, 1), 1, 0.15);
}

TEST(FitPose, TwiceTheNoiseMakesTheVolumeLarger) {
  const auto fine = fit_pose(truth(), correspondences(12, 0.1), prior, 20);
  const auto coarse = fit_pose(truth(), correspondences(12, 0.2), prior, 20);
  // Six of the nine unknowns are measured: the camera's three come mostly from their prior.
  EXPECT_GT(coarse.log_volume - fine.log_volume, 5 * std::log(2.0));
  EXPECT_LT(coarse.log_volume - fine.log_volume, 9 * std::log(2.0));
}

}  // namespace
}  // namespace helicarm::fiducials
