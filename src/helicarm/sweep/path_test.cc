// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/path.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/sweep/drawn_run_test.h"

namespace helicarm::sweep {
namespace {

const Detector detector{{256, 256}, 1.0, 1.0};

calibration::ViewCovariance::ColXpr::PlainObject parameters_of(const geometry::View& view,
                                                               const geometry::View& about) {
  calibration::ViewCovariance::ColXpr::PlainObject p;
  const Eigen::AngleAxisd turn(view.camera_from_world.rotation *
                               about.camera_from_world.rotation.transpose());
  const geometry::Intrinsics& k = view.intrinsics;
  p << k.fx, k.fy, k.u0, k.v0, turn.angle() * turn.axis(), view.camera_from_world.translation, k.skew;
  return p;
}

TEST(PlacedCamera, IsTheViewAgain) {
  for (const double aspect : {1.0, -1.0}) {
    geometry::View view = DrawnRun{}.view(3);
    view.intrinsics.fx *= aspect;
    const Detector of{{256, 200}, 0.5, aspect};
    const geometry::View again = view_of(placed(view, of), of);
    EXPECT_LT((again.projection() - view.projection()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Orbit, FollowsCamerasThatTurn) {
  const DrawnRun run;
  std::vector<PlacedCamera> cameras;
  for (int i = 0; i < 60; ++i) cameras.push_back(placed(run.view(i), detector));
  const OrbitFit fit = fit_orbit(cameras, Eigen::Vector3d::Zero());
  ASSERT_TRUE(fit.orbit.axis);
  EXPECT_NEAR(std::abs(fit.orbit.axis->z()), 1, 1e-6);
  EXPECT_NEAR(std::abs(fit.angles_deg.back()), 59 * run.step_deg, 0.5);
  for (std::size_t i = 0; i < cameras.size(); ++i)
    EXPECT_LT((fit.orbit.at(fit.angles_deg[i]).source - cameras[i].source).norm(), 3);
}

TEST(Orbit, PassesWhereTheCamerasTurnWhereverThePhantomIs) {
  const DrawnRun run;
  std::vector<PlacedCamera> cameras;
  for (int i = 0; i < 40; ++i) cameras.push_back(placed(run.view(i), detector));
  const OrbitFit fit = fit_orbit(cameras, {60, -45, 20});
  EXPECT_LT((fit.orbit.centre - fit.orbit.axis->dot(fit.orbit.centre) * *fit.orbit.axis).norm(), 3);
  for (std::size_t i = 0; i < cameras.size(); ++i)
    EXPECT_LT((fit.orbit.at(fit.angles_deg[i]).source - cameras[i].source).norm(), 3);
}

TEST(Orbit, RestsWhereOnlyTheSourceMoves) {
  std::vector<PlacedCamera> cameras;
  for (int i = 0; i < 20; ++i) {
    PlacedCamera camera = placed(DrawnRun{}.view(0), detector);
    camera.source.y() += 10 * i;
    cameras.push_back(camera);
  }
  EXPECT_FALSE(fit_orbit(cameras, Eigen::Vector3d::Zero()).orbit.axis);
}

TEST(PlacedCamera, ParametersByDeviationAreTheirDerivatives) {
  const PlacedCamera reference = placed(DrawnRun{}.view(2), detector);
  CameraVector at;
  at << 1, -2, 3, 2, 1, -1, 0.01, -0.02, 0.005;
  const auto by = parameters_by_deviation(deviated(reference, at), reference, detector);
  const geometry::View view = view_of(deviated(reference, at), detector);
  EXPECT_LT((deviation_of(deviated(reference, at), reference) - at).cwiseAbs().maxCoeff(), 1e-9);
  for (Eigen::Index k = 0; k < camera_size; ++k) {
    const double step = k < 6 ? 1e-4 : 1e-7;
    const auto moved = [&](double sign) {
      PlacedCamera camera = deviated(reference, at);
      const CameraVector only = sign * step * CameraVector::Unit(k);
      // The rotation's step is in the camera's axes, after the deviation.
      camera.source += reference.rotation.transpose() * only.head<3>();
      camera.detector += reference.rotation.transpose() * only.segment<3>(3);
      const double angle = only.tail<3>().norm();
      if (angle > 0)
        camera.rotation =
            Eigen::AngleAxisd(angle, only.tail<3>() / angle).toRotationMatrix() * camera.rotation;
      return parameters_of(view_of(camera, detector), view);
    };
    const auto numeric = ((moved(1) - moved(-1)) / (2 * step)).eval();
    EXPECT_LT((numeric - by.col(k)).cwiseAbs().maxCoeff(), 1e-4 * (1 + by.col(k).cwiseAbs().maxCoeff())) << k;
  }
}

/// The balls as this camera sees them.
FramePoints points_in(const geometry::View& view) {
  FramePoints points;
  for (const Eigen::Vector3d& ball : DrawnRun::balls()) {
    points.points.push_back(ball);
    points.pixels.push_back(view.project(ball));
    points.balls.push_back(points.balls.size());
  }
  const auto n = Eigen::Index(points.points.size());
  points.whitening = Eigen::MatrixXd::Identity(n, n) / 0.02;
  return points;
}

const Orbit about_z{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero(), placed(DrawnRun{}.view(0), detector)};

TEST(PathObservation, ExactPointsGiveTheCameraThatTookThem) {
  const geometry::View truth = DrawnRun{}.view(4);
  const FramePoints points = points_in(truth);
  PlacedCamera at = placed(truth, detector);
  at.source += Eigen::Vector3d(0.5, -0.3, 0.2);
  for (int i = 0; i < 4; ++i)
    at = deviated(about_z.at(20), observation_of(points, at, 20, about_z, detector).value);
  EXPECT_LT((at.source - truth.source_in_world()).norm(), 1e-6);
}

TEST(PathObservation, ValueFollowsThePixelsAsItsDerivativeStates) {
  constexpr double step_px = 1e-4, angle_deg = 20;
  constexpr std::size_t moved = 3;
  const geometry::View truth = DrawnRun{}.view(4);
  const FramePoints points = points_in(truth);
  const PlacedCamera at = placed(truth, detector);
  const PathObservation observation = observation_of(points, at, angle_deg, about_z, detector);
  Eigen::MatrixXd roots = Eigen::MatrixXd::Zero(Eigen::Index(points.points.size()), 1);
  roots(moved, 0) = 1;
  const Eigen::MatrixXd by = value_by_pixels(points, at, observation, about_z.at(angle_deg), detector, roots);
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    FramePoints shifted = points;
    shifted.pixels[moved][axis] += step_px;
    const CameraVector change =
        (observation_of(shifted, at, angle_deg, about_z, detector).value - observation.value) / step_px;
    EXPECT_LT((change - by.col(axis)).norm(), 1e-5 * by.col(axis).norm()) << axis;
  }
}

TEST(FreeShares, AFitTakesAsManyDegreesOfFreedomAsItHasParameters) {
  const geometry::View truth = DrawnRun{}.view(4);
  const FramePoints points = points_in(truth);
  const PlacedCamera at = placed(truth, detector);
  const PathObservation observation = observation_of(points, at, 20, about_z, detector);
  double taken = 0;
  for (const double share :
       free_shares(points, at, observation.information.inverse(), about_z.at(20), detector))
    taken += 2 * (1 - share);
  EXPECT_NEAR(taken, camera_size, 1e-3);
}

}  // namespace
}  // namespace helicarm::sweep
