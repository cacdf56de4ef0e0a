// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/smooth.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::track {
namespace smooth_test {

const Eigen::Vector3d centre(20, -10, 5);

geometry::RigidTransform pose_at(double t) {
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector({0.5 * std::sin(0.11 * t), 0.02 * t, 0.1});
  const Eigen::Vector3d place(10 * std::sin(0.07 * t), 5 * std::cos(0.13 * t), 0.2 * t);
  return {rotation, place - rotation * centre};
}

struct Data {
  std::vector<double> times;
  std::vector<std::optional<FramePose>> measured;
};

Data measured_at(int frames, int gap_first, int gap_last, unsigned seed) {
  constexpr double sigma_rad = 0.003, sigma_mm = 0.1;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Data data;
  for (int i = 0; i < frames; ++i) {
    data.times.push_back(i);
    registration::RigidStep step;
    for (int k = 0; k < 6; ++k) step[k] = (k < 3 ? sigma_rad : sigma_mm) * normal(random);
    auto& made = data.measured.emplace_back();
    if (i >= gap_first && i <= gap_last) continue;
    made.emplace();
    made->pose = registration::moved_about(pose_at(i), pose_at(i) * centre, step);
    made->covariance.diagonal() << sigma_rad * sigma_rad * Eigen::Vector3d::Ones(),
        sigma_mm * sigma_mm * Eigen::Vector3d::Ones();
  }
  return data;
}

registration::RigidStep error_of(const FramePose& frame, double t) {
  return registration::step_about(frame.pose, pose_at(t), frame.pose * centre);
}

TEST(Smooth, HalvesTheErrorAndItsBandsHoldTheTruth) {
  int inside = 0, all = 0;
  double squares = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Data data = measured_at(100, -1, -1, seed);
    const auto motion = smooth_poses(data.times, data.measured, centre);
    ASSERT_TRUE(motion);
    for (std::size_t i = 0; i < data.times.size(); ++i) {
      const auto off = error_of(motion->frames[i], data.times[i]);
      squares += off.tail<3>().squaredNorm() / 3;
      for (int k = 0; k < 6; ++k, ++all)
        inside += std::abs(off[k]) < 1.96 * std::sqrt(motion->frames[i].covariance(k, k));
    }
  }
  EXPECT_LT(std::sqrt(squares / 400), 0.07);
  EXPECT_NEAR(double(inside) / all, 0.95, 0.04);
}

TEST(Smooth, CovariancesThatAreTooSmallAreScaledByTheData) {
  int inside = 0, all = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Data data = measured_at(100, -1, -1, seed);
    for (auto& pose : data.measured) pose->covariance /= 9;
    const auto motion = smooth_poses(data.times, data.measured, centre, NoiseScale::by_data);
    ASSERT_TRUE(motion);
    EXPECT_NEAR(motion->noise_factor, 3, 0.4);
    for (std::size_t i = 0; i < data.times.size(); ++i) {
      const auto off = error_of(motion->frames[i], data.times[i]);
      for (int k = 0; k < 6; ++k, ++all)
        inside += std::abs(off[k]) < 1.96 * std::sqrt(motion->frames[i].covariance(k, k));
    }
  }
  EXPECT_NEAR(double(inside) / all, 0.95, 0.04);
}

TEST(Smooth, ErrorsThatTheScatterDoesNotShowStayInTheBands) {
  Data data = measured_at(100, -1, -1, 1);
  const auto fair = smooth_poses(data.times, data.measured, centre);
  for (auto& pose : data.measured) pose->covariance *= 9;
  const auto motion = smooth_poses(data.times, data.measured, centre, NoiseScale::by_data);
  ASSERT_TRUE(motion && fair);
  EXPECT_NEAR(motion->noise_factor, 1.0 / 3, 0.05);
  EXPECT_LT(registration::step_about(motion->frames[50].pose, fair->frames[50].pose, Eigen::Vector3d::Zero())
                .norm(),
            0.05);
  EXPECT_GT(motion->frames[50].covariance(3, 3), 0.8 * data.measured[50]->covariance(3, 3));
}

TEST(Smooth, PlacesAndTurnsHaveFactorsOfTheirOwn) {
  int inside = 0, all = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Data data = measured_at(100, -1, -1, seed);
    registration::RigidStep factors;
    factors << Eigen::Vector3d::Constant(1.0 / 3), Eigen::Vector3d::Constant(3);
    for (auto& pose : data.measured)
      pose->covariance = factors.asDiagonal() * pose->covariance * factors.asDiagonal();
    const auto motion = smooth_poses(data.times, data.measured, centre, NoiseScale::by_data);
    ASSERT_TRUE(motion);
    EXPECT_NEAR(motion->turn_noise_factor, 3, 0.5);
    EXPECT_NEAR(motion->noise_factor, 1.0 / 3, 0.06);
    for (std::size_t i = 0; i < data.times.size(); ++i) {
      const auto off = error_of(motion->frames[i], data.times[i]);
      for (int k = 0; k < 3; ++k, ++all)
        inside += std::abs(off[k]) < 1.96 * std::sqrt(motion->frames[i].covariance(k, k));
    }
  }
  EXPECT_NEAR(double(inside) / all, 0.95, 0.04);
}

TEST(Smooth, GapIsFilledWithAWidthThatGrows) {
  const Data data = measured_at(80, 40, 51, 9);
  const auto motion = smooth_poses(data.times, data.measured, centre);
  ASSERT_TRUE(motion);
  const auto width = [&](std::size_t i) { return std::sqrt(motion->frames[i].covariance(5, 5)); };
  EXPECT_GT(width(45), 2 * width(30));
  EXPECT_GT(width(45), width(41));
  for (std::size_t i = 40; i <= 51; ++i)
    for (int k = 0; k < 6; ++k)
      EXPECT_LT(std::abs(error_of(motion->frames[i], data.times[i])[k]),
                4 * std::sqrt(motion->frames[i].covariance(k, k)));
}

TEST(Smooth, TwoFramesAreTooFew) {
  const Data data = measured_at(2, -1, -1, 1);
  EXPECT_FALSE(smooth_poses(data.times, data.measured, centre));
}

TEST(Smooth, PlacesOfAPointAreSmoothedToo) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  std::vector<double> times;
  std::vector<std::optional<FramePlace>> measured;
  for (int i = 0; i < 60; ++i) {
    times.push_back(i);
    measured.emplace_back(FramePlace{
        pose_at(i) * centre + 0.1 * Eigen::Vector3d(normal(random), normal(random), normal(random)),
        0.01 * Eigen::Matrix3d::Identity()});
  }
  const auto places = smooth_places(times, measured);
  ASSERT_TRUE(places);
  double squares = 0;
  for (std::size_t i = 0; i < times.size(); ++i)
    squares += ((*places)[i].place - pose_at(times[i]) * centre).squaredNorm() / 3;
  EXPECT_LT(std::sqrt(squares / 60), 0.075);
}

}  // namespace smooth_test
}  // namespace helicarm::track
