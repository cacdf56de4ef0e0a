// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/run_noise.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::sweep {
namespace {

constexpr std::size_t frame_count = 60, ball_count = 12;
using Frames = std::vector<std::vector<NoiseSample>>;

Eigen::Vector2d drawn(RandomStream& random, double sigma) {
  const double u = random.normal(), v = random.normal();
  return sigma * Eigen::Vector2d(u, v);
}

/// Every fifth ball is noisy, which its image states; `share_displaced` are ten times as wide, which nothing
/// states.
Frames run_of(double image_factor, double floor_px, double share_displaced, std::uint64_t seed = 5) {
  RandomStream random{seed, 0};
  Frames frames(frame_count);
  for (auto& frame : frames)
    for (std::size_t ball = 0; ball < ball_count; ++ball) {
      const double image = ball % 5 == 0 ? 0.05 * 0.05 : 0.005 * 0.005;
      const double sigma = std::sqrt(image_factor * image + floor_px * floor_px) *
                           (random.uniform(0, 1) < share_displaced ? 10 : 1);
      frame.push_back({ball, drawn(random, sigma), image});
    }
  return frames;
}

TEST(RunNoise, FactorAndFloorOfNormalNoiseAreFound) {
  const RunNoise noise = noise_of(run_of(2, 0.01, 0));
  EXPECT_GE(noise.freedom, 20);
  EXPECT_NEAR(noise.image_factor, 2, 0.5);
  EXPECT_NEAR(noise.floor_px, 0.01, 0.001);
  EXPECT_LT(noise.shared, 1.2);
  EXPECT_NEAR(noise.variance_px2[0][0] / noise.shared, 2 * 0.0025 + 0.0001, 0.0015);
  EXPECT_NEAR(noise.variance_px2[0][1] / noise.shared, 2 * 0.000025 + 0.0001, 0.00004);
}

TEST(RunNoise, DisplacedCentresLoseTheirWeightAndDoNotWidenTheOthers) {
  const Frames frames = run_of(1, 0.01, 0.1);
  const RunNoise noise = noise_of(frames);
  EXPECT_LE(noise.freedom, 4);
  EXPECT_LT(noise.floor_px, 0.012);
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (std::size_t k = 0; k < frames[i].size(); ++k)
      if (k % 5 != 0 && frames[i][k].residual_px.norm() > 0.1) {
        EXPECT_GT(noise.variance_px2[i][k], 0.001);
      }
}

TEST(RunNoise, InformationIsThatOfTheWeightedMean) {
  double squares = 0;
  constexpr int runs = 60, rounds = 4;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    Frames frames = run_of(1, 0.01, 0.1, seed);
    frames.resize(15);
    Eigen::Vector2d location = Eigen::Vector2d::Zero();
    double information = 0;
    for (int round = 0; round < rounds; ++round) {
      const RunNoise noise = noise_of(frames);
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      information = 0;
      for (std::size_t i = 0; i < frames.size(); ++i)
        for (std::size_t k = 0; k < frames[i].size(); ++k) {
          sum += noise.shared / noise.variance_px2[i][k] * frames[i][k].residual_px;
          information += noise.shared / noise.variance_px2[i][k];
        }
      location += sum / information;
      for (auto& frame : frames)
        for (NoiseSample& sample : frame) sample.residual_px -= sum / information;
    }
    squares += location.squaredNorm() * information / 2;
  }
  EXPECT_NEAR(squares / runs, 1, 0.3);
}

TEST(RunNoise, ErrorsThatNeighboursShareWidenAll) {
  Frames frames = run_of(1, 0.01, 0);
  for (std::size_t i = frames.size(); --i > 0;)
    for (std::size_t k = 0; k < ball_count; ++k) frames[i][k].residual_px += frames[i - 1][k].residual_px;
  const RunNoise noise = noise_of(frames);  // correlation of neighbours 1/2: twice the variance of a mean
  EXPECT_NEAR(noise.shared, 2, 0.35);
}

}  // namespace
}  // namespace helicarm::sweep
