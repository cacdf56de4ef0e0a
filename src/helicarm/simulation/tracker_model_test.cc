// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/tracker_model.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/simulation/random_pose.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr std::uint64_t seed = 5;

/// The array's normal towards the camera, slightly tilted.
geometry::RigidTransform facing_pose() {
  const Eigen::Matrix3d back = Vector3d(1, -1, -1).asDiagonal();
  return {geometry::rotation_from_vector({0.2, -0.3, 0.4}) * back, {60, -40, 900}};
}

TrackedPath at_rest(const geometry::RigidTransform& pose) {
  return [pose](double) { return pose; };
}

Vector6d error_of(const TrackerSample& sample) {
  Vector6d error;
  error << geometry::vector_from_rotation(sample.tracker_from_body->rotation *
                                          sample.truth.rotation.transpose()),
      sample.tracker_from_body->translation - sample.truth.translation;
  return error;
}

std::size_t valid_among(const std::vector<TrackerSample>& samples) {
  return static_cast<std::size_t>(std::ranges::count_if(samples, &TrackerSample::valid));
}

TEST(TrackerModel, SamplesScatterByTheCovariance) {
  constexpr std::size_t count = 20000;
  for (const TrackedBody& body : {marker_array(), calibrator_markers()}) {
    geometry::RigidTransform pose = facing_pose();
    if (body.facets.size() > 1) pose.rotation = pose.rotation * geometry::rotation_from_vector({1.2, 0, 0});
    const TrackerModel model;
    const auto samples = track(model, body, at_rest(pose), steady_times(60, count), seed, 7);
    Matrix6d sum = Matrix6d::Zero();
    for (const TrackerSample& sample : samples) sum += error_of(sample) * error_of(sample).transpose();
    // Whitened by the model's covariance the scatter is the identity within 5 standard errors.
    const Matrix6d model_root = pose_covariance(model, body, pose)->llt().matrixL();
    const Matrix6d inverse = model_root.inverse();
    const Matrix6d white = inverse * (sum / count) * inverse.transpose();
    EXPECT_LT((white - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 5 * std::sqrt(2.0 / count));
  }
}

TEST(TrackerModel, DepthIsWorseThanAcross) {
  const Matrix6d covariance = *pose_covariance({}, marker_array(), facing_pose());
  EXPECT_NEAR(std::sqrt(covariance(5, 5) / covariance(3, 3)), 2.5, 0.1);
}

TEST(TrackerModel, MeanOfAWindowScattersByItsCovariance) {
  TrackerModel model;
  model.drift_sigma_mm = {0.07, 0.07, 0.17};
  constexpr int readings = 3000;
  Vector6d squares = Vector6d::Zero();
  for (std::uint64_t reading = 0; reading < readings; ++reading) {
    const auto samples =
        track(model, marker_array(), at_rest(facing_pose()), steady_times(60, 6), reading, 7);
    TrackerSample mean = samples.front();
    mean.tracker_from_body = mean_pose(samples);
    squares += error_of(mean).cwiseAbs2() / readings;
  }
  const Vector6d expected = pose_covariance(model, marker_array(), facing_pose(), 6)->diagonal();
  EXPECT_LT((squares.cwiseQuotient(expected).array() - 1).abs().maxCoeff(), 5 * std::sqrt(2.0 / readings));
}

TEST(TrackerModel, BodyTurnedAwayIsNotVisible) {
  const TrackerModel model;
  const auto spun = [](double angle) {
    return geometry::RigidTransform{geometry::rotation_from_vector({0, angle, 0}), {0, 0, 900}};
  };
  for (double angle_deg = 0; angle_deg < 360; angle_deg += 10) {
    const TrackerSample sample =
        track_sample(model, marker_array(), at_rest(spun(angle_deg * radian)), 0, seed, 7, 0);
    const double from_camera_deg = std::abs(angle_deg - 180);
    if (from_camera_deg < 60) {
      EXPECT_TRUE(sample.valid()) << angle_deg;
    }
    if (from_camera_deg > 75) {
      EXPECT_FALSE(sample.valid()) << angle_deg;
    }
    EXPECT_EQ(sample.valid(), pose_covariance(model, marker_array(), sample.truth).has_value());
  }
}

TEST(TrackerModel, CalibratorShowsOneOrTwoFacetsAroundItsAxisAndNoneFromItsEnds) {
  const Eigen::Matrix3d upright = geometry::rotation_from_vector({EIGEN_PI / 2, 0, 0});
  for (double angle = 0; angle < 6.28; angle += 0.1) {
    const geometry::RigidTransform pose{upright * geometry::rotation_from_vector({0, 0, angle}), {0, 0, 900}};
    const int facets = track_sample({}, calibrator_markers(), at_rest(pose), 0, seed, 7, 0).facets;
    EXPECT_GE(facets, 1) << angle;
    EXPECT_LE(facets, 2) << angle;
  }
  EXPECT_FALSE(pose_covariance({}, calibrator_markers(), {Eigen::Matrix3d::Identity(), {0, 0, 900}}));
}

TEST(TrackerModel, NothingIsVisibleOutsideTheVolume) {
  for (const Vector3d& place : {Vector3d(0, 0, 400), Vector3d(0, 0, 2600), Vector3d(800, 0, 900)}) {
    geometry::RigidTransform pose = facing_pose();
    pose.translation = place;
    EXPECT_FALSE(track_sample({}, marker_array(), at_rest(pose), 0, seed, 7, 0).valid());
  }
}

TEST(TrackerModel, SamplesAndFacetsAreLostAtTheGivenRates) {
  constexpr std::size_t count = 20000;
  TrackerModel model;
  model.lost_sample = 0.1;
  model.lost_facet = 0.2;
  model.outlier = 0.05;
  const auto samples = track(model, marker_array(), at_rest(facing_pose()), steady_times(60, count), seed, 7);
  const double kept = 0.9 * 0.8;
  EXPECT_NEAR(double(valid_among(samples)) / count, kept, 5 * std::sqrt(kept * (1 - kept) / count));
  const auto wrong = std::ranges::count_if(samples, &TrackerSample::outlier);
  EXPECT_NEAR(double(wrong) / (kept * count), 0.05, 0.01);
  for (const TrackerSample& sample : samples)
    if (sample.valid() && !sample.outlier) {
      EXPECT_LT(error_of(sample).tail<3>().norm(), 1);
    }
  model.lost_sample = 1;
  EXPECT_FALSE(mean_pose(track(model, marker_array(), at_rest(facing_pose()), steady_times(60, 9), seed, 7)));
}

TEST(TrackerModel, StampsAreLateAndJitterWhileThePoseIsOfTheTrueTime) {
  TrackerModel model;
  model.stamp_delay_s = 0.03;
  model.stamp_jitter_s = 0.002;
  const TrackedPath moving = [](double t) {
    return geometry::RigidTransform{facing_pose().rotation, {100 * t, 0, 900}};
  };
  constexpr std::size_t count = 5000;
  const auto times = steady_times(20, count);
  double sum = 0;
  double squares = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const TrackerSample sample = track_sample(model, marker_array(), moving, times[i] / 500, seed, 7, i);
    EXPECT_EQ(sample.truth.translation.x(), 100 * sample.exposed_s);
    const double late = sample.stamp_s - sample.exposed_s - 0.03;
    sum += late;
    squares += late * late;
  }
  EXPECT_NEAR(sum / count, 0, 5 * 0.002 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 0.002, 0.0002);
}

TEST(TrackerModel, DriftHasTheGivenTimeAndAmplitude) {
  TrackerModel model;
  model.marker_sigma_mm.setZero();
  model.drift_sigma_mm = {0.1, 0.1, 0.3};
  model.drift_time_s = 10;
  double now2 = 0;
  double soon = 0;
  double late = 0;
  constexpr int streams = 3000;
  for (std::uint64_t trial = 0; trial < streams; ++trial) {
    const auto samples =
        track(model, marker_array(), at_rest(facing_pose()), std::vector<double>{100, 100.02, 110}, trial, 7);
    const auto z = [&](std::size_t i) { return error_of(samples[i])[5] / 0.3; };
    now2 += z(0) * z(0) / streams;
    soon += std::abs(z(1) - z(0)) / streams;
    late += z(0) * z(2) / streams;
  }
  EXPECT_NEAR(now2, 1, 0.13);
  EXPECT_LT(soon, 0.01);
  EXPECT_NEAR(late, std::exp(-0.5), 0.1);
}

TEST(TrackerModel, EverySampleIsIndependentlyReproducible) {
  TrackerModel model;
  model.stamp_jitter_s = 0.001;
  model.lost_sample = 0.2;
  model.outlier = 0.1;
  model.drift_sigma_mm.setConstant(0.1);
  const auto times = steady_times(60, 50);
  const auto all = track(model, marker_array(), at_rest(facing_pose()), times, seed, 7);
  const auto other = track(model, marker_array(), at_rest(facing_pose()), times, seed + 1, 7);
  for (std::size_t i = times.size(); i-- > 0;) {
    const TrackerSample alone =
        track_sample(model, marker_array(), at_rest(facing_pose()), times[i], seed, 7, i);
    EXPECT_EQ(alone.stamp_s, all[i].stamp_s);
    ASSERT_EQ(alone.valid(), all[i].valid());
    EXPECT_NE(alone.stamp_s, other[i].stamp_s);
    if (alone.valid()) {
      EXPECT_EQ(alone.tracker_from_body->matrix(), all[i].tracker_from_body->matrix());
    }
  }
}

}  // namespace
}  // namespace helicarm::simulation
