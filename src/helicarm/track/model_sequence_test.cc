// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/model_sequence.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::track {
namespace model_sequence_test {

using case_registration::RegisteredFrame;
using registration::Registration;

const Eigen::Vector3d centre(10, 0, -5);
constexpr double sigma_rad = 0.002, sigma_mm = 0.1;

geometry::RigidTransform pose_at(double t) {
  return {geometry::rotation_from_vector({0.3 * std::sin(0.1 * t), 0.01 * t, 0}),
          {8 * std::sin(0.08 * t), 0.3 * t, 100}};
}

Registration registration_at(double t, std::mt19937& random) {
  std::normal_distribution<double> normal;
  registration::RigidStep step;
  for (int k = 0; k < 6; ++k) step[k] = (k < 3 ? sigma_rad : sigma_mm) * normal(random);
  Registration made;
  made.name = "femur";
  made.decision = registration::Decision::accept;
  made.centre = pose_at(t) * centre;
  made.world_from_model = registration::moved_about(pose_at(t), made.centre, step);
  made.covariance.setZero();
  made.covariance.diagonal() << sigma_rad * sigma_rad * Eigen::Vector3d::Ones(),
      sigma_mm * sigma_mm * Eigen::Vector3d::Ones();
  return made;
}

ModelSequence sequence_of(int frames) {
  std::mt19937 random(7);
  ModelSequence sequence;
  sequence.names = {"femur"};
  for (int f = 0; f < frames; ++f) {
    sequence.frames.push_back(f);
    sequence.registered.push_back({f, {registration_at(f, random)}});
  }
  return sequence;
}

double error_mm(const TrackedBody& frame, int f) {
  const Eigen::Vector3d then = pose_at(0) * centre;
  return (frame.pose->pose * then - pose_at(f) * pose_at(0).inverse() * then).norm();
}

TEST(ModelSequence, SmoothMotionIsNearerThanTheFrames) {
  ModelSequence sequence = sequence_of(80);
  estimate_motion(sequence, {centre});
  double own = 0, smooth = 0;
  for (int f = 1; f < 80; ++f) {
    own += std::pow(error_mm(sequence.bodies[0].frames[std::size_t(f)], f), 2);
    smooth += std::pow(error_mm(sequence.bodies[0].smoothed[std::size_t(f)], f), 2);
  }
  EXPECT_LT(smooth, 0.6 * own);
  EXPECT_NEAR(sequence.bodies[0].noise_factor, 1, 0.2);
}

TEST(ModelSequence, RefusedFramesAreGapsWithWiderBands) {
  ModelSequence sequence = sequence_of(40);
  for (int f = 18; f < 32; ++f) {
    Registration& model = sequence.registered[std::size_t(f)].models[0];
    model.decision = registration::Decision::refuse;
    model.failure = Failure{Reason::wrong_model, "femur: another bone", {}, {}};
    model.world_from_model.translation.x() += 30;
  }
  estimate_motion(sequence, {centre});
  const BodySequence& body = sequence.bodies[0];
  EXPECT_FALSE(body.frames[25].pose);
  EXPECT_EQ(body.frames[25].decision, PoseDecision::refuse);
  ASSERT_TRUE(body.smoothed[25].pose);
  EXPECT_EQ(body.smoothed[25].decision, PoseDecision::warn);
  EXPECT_EQ(body.smoothed[25].reason, Reason::wrong_model);
  EXPECT_GT(body.smoothed[25].pose->covariance(3, 3), 1.5 * body.smoothed[12].pose->covariance(3, 3));
  EXPECT_LT(error_mm(body.smoothed[25], 25), 4 * std::sqrt(3 * body.smoothed[25].pose->covariance(3, 3)));
}

TEST(ModelSequence, ErrorOfTheSizeIsOneInAllFrames) {
  ModelSequence sequence = sequence_of(40);
  for (RegisteredFrame& frame : sequence.registered) {
    Registration& model = frame.models[0];
    model.by_scale << 0, 0, 0, 0, 0, 2;
    // The last frame's views are others: there its size moves the body along another axis.
    if (&frame == &sequence.registered.back()) model.by_scale << 0, 0, 0, 0, 2, 0;
    model.covariance += model.by_scale * model.by_scale.transpose();
  }
  estimate_motion(sequence, {centre});
  const auto sigma = [&](const TrackedBody& frame, int axis) {
    return std::sqrt(frame.pose->covariance(axis, axis));
  };
  const BodySequence& body = sequence.bodies[0];
  EXPECT_LT(sigma(body.frames[1], 5), 2 * sigma_mm);
  EXPECT_LT(sigma(body.smoothed[20], 5), 0.7);  // the body has turned by 0.3 rad
  EXPECT_GT(sigma(body.frames[39], 5), 1.5);
  EXPECT_GT(sigma(body.frames[39], 4), 1.5);
}

TEST(ModelSequence, ALineOfAFrameIsReadBackToTheLastBit) {
  ModelSequence sequence = sequence_of(3);
  Registration& odd = sequence.registered[1].models[0];
  odd.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  odd.failure = Failure{Reason::wrong_model, "femur: \"another\" bone", "AP", {{"score", 0.25}}};
  odd.warnings.push_back({Reason::covariance_missing, "no covariance", {}, {}});
  odd.by_scale << 1, 2, 3, 4, 5, 1.0 / 3;
  odd.views.emplace_back().name = "AP";
  odd.views.back().residual_px = 0.1;
  std::string lines;
  for (const RegisteredFrame& frame : sequence.registered) lines += frame_line(frame);
  const auto read = frames_from(lines, sequence.names, sequence.frames);
  ASSERT_EQ(read.size(), 3u);
  std::string again;
  for (const RegisteredFrame& frame : read) again += frame_line(frame);
  EXPECT_EQ(again, lines);
  EXPECT_EQ(read[2].models[0].world_from_model.matrix(),
            sequence.registered[2].models[0].world_from_model.matrix());
  EXPECT_FALSE(read[1].models[0].is_determined());
  EXPECT_EQ(read[1].models[0].by_scale, odd.by_scale);
  EXPECT_EQ(read[1].models[0].failure->figures.at("score"), 0.25);
}

TEST(ModelSequence, FramesUpToAnIncompleteLineAreRead) {
  const ModelSequence sequence = sequence_of(3);
  std::string lines;
  for (const RegisteredFrame& frame : sequence.registered) lines += frame_line(frame);
  EXPECT_EQ(frames_from(lines.substr(0, lines.size() - 5), sequence.names, sequence.frames).size(), 2u);
  EXPECT_EQ(frames_from(lines, sequence.names, {0, 2}).size(), 1u);
  EXPECT_TRUE(frames_from("{}\n", sequence.names, sequence.frames).empty());
}

}  // namespace model_sequence_test
}  // namespace helicarm::track
