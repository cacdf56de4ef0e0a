// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/smooth_path.h"

#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::sweep {
namespace {

constexpr double arc_deg = 180;

struct Simulated {
  std::vector<PathObservation> frames;
  std::vector<CameraVector> cameras;
};

/// Cameras about a sinusoid, each measured with the same correlated errors; of a gantry that all but rests in
/// the first frames.
Simulated simulated(int count, double jitter_mm, double seed, int resting = 0) {
  RandomStream random{std::uint64_t(seed), 0};
  const auto normals = [&] {
    CameraVector values;
    for (Eigen::Index k = 0; k < camera_size; ++k) values[k] = random.normal();
    return values;
  };
  CameraVector unit;
  unit << 1, 1, 1, 1, 1, 1, 2e-3, 2e-3, 2e-3;
  Simulated made;
  for (int i = 0; i < count; ++i) {
    const double angle = i < resting ? 1e-4 * i : arc_deg * (i - resting) / (count - resting - 1);
    const double phase = angle * EIGEN_PI / 180;
    CameraVector camera = 2 * std::sin(phase) * unit + jitter_mm * unit.cwiseProduct(normals());
    CameraMatrix root = 0.3 * unit.asDiagonal().toDenseMatrix();
    root(3, 0) = 0.25;  // source and detector together
    PathObservation frame;
    frame.angle_deg = angle;
    frame.value = camera + root * normals();
    frame.information = (root * root.transpose()).inverse();
    frame.turn.setZero();
    frame.motion.setZero();
    frame.motion.topRightCorner<3, 3>().setIdentity();
    frame.motion.block<3, 3>(3, 3).setIdentity();
    frame.motion.bottomLeftCorner<3, 3>().setIdentity();
    made.frames.push_back(frame);
    made.cameras.push_back(camera);
  }
  return made;
}

double covered(const Simulated& simulation, const SmoothPath& path, std::size_t first = 0) {
  constexpr double limit = 7.815;  // chi2 of 3 degrees of freedom, 95 %
  double inside = 0;
  for (std::size_t i = first; i < path.points.size(); ++i) {
    const Eigen::Vector3d off = (path.points[i].camera - simulation.cameras[i]).head<3>();
    inside += off.dot(path.points[i].camera_covariance.topLeftCorner<3, 3>().ldlt().solve(off)) < limit;
  }
  return inside / double(path.points.size() - first);
}

TEST(SmoothPath, JitterOfTheFramesIsFoundAndItsRegionsHold) {
  for (const double jitter : {0.02, 0.5}) {
    const Simulated simulation = simulated(120, jitter, 7);
    const Stiffness stiffness = choose_stiffness(simulation.frames, {});
    EXPECT_NEAR(stiffness.jitter[0], jitter, 0.15);
    const SmoothPath path = smooth_path(simulation.frames, {}, stiffness);
    EXPECT_GT(covered(simulation, path), 0.9) << jitter;
  }
}

TEST(SmoothPath, WhereImagesShowTheSumOfBothJittersBothAreAlike) {
  constexpr double jitter_mm = 0.1;
  Simulated simulation = simulated(120, jitter_mm, 11);
  CameraVector precision;
  precision << Eigen::Vector3d::Constant(1 / 0.02), Eigen::Vector3d::Constant(1 / 2.0),
      Eigen::Vector3d::Constant(1 / 1e-3);
  CameraMatrix sum_and_difference = CameraMatrix::Identity();
  sum_and_difference.topLeftCorner<6, 6>() << Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(),
      Eigen::Matrix3d::Identity(), -Eigen::Matrix3d::Identity();
  const CameraMatrix root = precision.asDiagonal() * sum_and_difference;
  RandomStream random{12, 0};
  for (std::size_t i = 0; i < simulation.frames.size(); ++i) {
    CameraVector noise;
    for (double& value : noise) value = random.normal();
    simulation.frames[i].value = simulation.cameras[i] + root.inverse() * noise;
    simulation.frames[i].information = root.transpose() * root;
  }
  const Stiffness stiffness = choose_stiffness(simulation.frames, {});
  EXPECT_NEAR(stiffness.jitter[0] / jitter_mm, 1, 0.2);
  EXPECT_NEAR(stiffness.jitter[1] / jitter_mm, 1, 0.2);
}

TEST(SmoothPath, IsNearerThanEachFrameAlone) {
  const Simulated simulation = simulated(120, 0.02, 9);
  const SmoothPath path = smooth_path(simulation.frames, {}, choose_stiffness(simulation.frames, {}));
  double smooth = 0, alone = 0;
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    smooth += (path.points[i].camera - simulation.cameras[i]).head<6>().squaredNorm();
    alone += (simulation.frames[i].value - simulation.cameras[i]).head<6>().squaredNorm();
  }
  EXPECT_LT(std::sqrt(smooth / alone), 0.5);
}

TEST(SmoothPath, AGantryThatRestsAtItsStartHasOnePath) {
  constexpr int resting = 30, seeds = 8;
  double moving = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Simulated simulation = simulated(120, 0.1, seed, resting);
    const Stiffness stiffness = choose_stiffness(simulation.frames, {});
    EXPECT_NEAR(stiffness.jitter[0], 0.1, 0.06);
    const SmoothPath path = smooth_path(simulation.frames, {}, stiffness);
    moving += covered(simulation, path, resting) / seeds;
    for (std::size_t i = 0; i < resting; ++i) {
      EXPECT_EQ(path.points[i].path, path.points.front().path);
      EXPECT_LT(path.points[i].path_covariance(0, 0),
                0.3 * simulation.frames.front().information.inverse()(0, 0));
    }
  }
  EXPECT_GT(moving, 0.9);  // the resting frames share their path's error, all inside or all outside
}

TEST(SmoothPath, AFreeTurnTakesNothingFromTheNeighbours) {
  Simulated simulation = simulated(60, 0.02, 3);
  for (PathObservation& frame : simulation.frames) frame.turn = CameraVector::Unit(0);
  const SmoothPath path = smooth_path(simulation.frames, {}, choose_stiffness(simulation.frames, {}));
  const CameraMatrix own = simulation.frames[30].information.inverse();
  // Only what correlates with the other numbers narrows it.
  EXPECT_GT(path.points[30].camera_covariance(0, 0), 0.2 * own(0, 0));
  EXPECT_LT(path.points[30].camera_covariance(1, 1), 0.2 * own(1, 1));
}

TEST(SmoothPath, AMotionOfThePhantomIsFoundWhereItHappens) {
  Simulated simulation = simulated(80, 0.03, 5);
  std::vector<std::size_t> order(simulation.frames.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  const Stiffness stiffness = choose_stiffness(simulation.frames, {});
  EXPECT_LT(find_step(simulation.frames, {}, stiffness, order)->chi2, 25);
  Eigen::Matrix<double, 6, 1> motion;
  motion << 0, 0, 0, 1.5, 0, 0;
  for (std::size_t i = 41; i < simulation.frames.size(); ++i)
    simulation.frames[i].value += simulation.frames[i].motion * motion;
  const auto step = find_step(simulation.frames, {}, choose_stiffness(simulation.frames, {}), order);
  EXPECT_GT(step->chi2, 40);
  EXPECT_EQ(step->first, 41u);
  EXPECT_NEAR(step->motion[3], 1.5, 0.4);
}

TEST(SmoothPath, AFrameOffThePathStandsOut) {
  Simulated simulation = simulated(60, 0.03, 11);
  simulation.frames[20].value[1] += 4;
  const SmoothPath path = smooth_path(simulation.frames, {}, choose_stiffness(simulation.frames, {}));
  EXPECT_GT(path.points[20].off_path_chi2, 60);
  EXPECT_LT(path.points[40].off_path_chi2, 40);
}

TEST(SmoothPath, ResponseIsTheChangeOfTheCameras) {
  const Simulated simulation = simulated(20, 0.1, 2);
  const Stiffness stiffness{{4e-3, 4e-3, 3e-5}, {0.1, 0.1, 1e-4}};
  std::vector<PathObservation> moved = simulation.frames;
  std::vector<Eigen::MatrixXd> change(20, Eigen::MatrixXd::Zero(camera_size, 1));
  for (std::size_t i = 0; i < 20; ++i) {
    change[i](Eigen::Index(i % 9), 0) = 0.01;
    moved[i].value += change[i];
  }
  const auto changed = response(simulation.frames, {}, stiffness, change);
  const SmoothPath before = smooth_path(simulation.frames, {}, stiffness),
                   after = smooth_path(moved, {}, stiffness);
  for (std::size_t i = 0; i < 20; ++i)
    EXPECT_LT((after.points[i].camera - before.points[i].camera - changed[i]).cwiseAbs().maxCoeff(), 1e-9);
}

}  // namespace
}  // namespace helicarm::sweep
