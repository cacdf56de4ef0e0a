// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/calibrated_view.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/pose_step.h"

namespace helicarm::calibration {
namespace {

TEST(SourceCovariance, AgreesWithPosesDrawnFromThatOfTheView) {
  CalibratedView view;
  view.view = {{4000, 4000, 512, 512, 0},
               {geometry::rotation_from_euler(0.4, -1.1, 2), Eigen::Vector3d(12, -35, 820)}};
  RandomStream random(7, 1, 0);
  Eigen::Matrix<double, 6, 6> root;
  for (double& number : root.reshaped()) number = random.normal();
  const Eigen::Vector<double, 6> scales(1e-3, 1e-3, 2e-3, 0.5, 0.4, 3);  // rad, then mm
  root = scales.asDiagonal() * root;
  view.covariance.block<6, 6>(4, 4) = root * root.transpose();
  const Eigen::Vector3d source = view.view.source_in_world();
  constexpr int draws = 40000;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int i = 0; i < draws; ++i) {
    Eigen::Vector<double, 6> normal;
    for (double& number : normal) number = random.normal();
    const Eigen::Vector<double, 6> drawn = root * normal;
    geometry::PoseStep step;
    step << drawn.tail<3>(), drawn.head<3>();
    geometry::View moved = view.view;
    moved.camera_from_world = geometry::moved(moved.camera_from_world, step);
    const Eigen::Vector3d error = moved.source_in_world() - source;
    spread += error * error.transpose() / draws;
  }
  EXPECT_LT((source_covariance(view) - spread).norm(), 0.03 * spread.norm());
}

}  // namespace
}  // namespace helicarm::calibration
