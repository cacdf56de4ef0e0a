// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/hypothesis_filter.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/fiducials/label_scene_test.h"
#include "helicarm/fiducials/three_point.h"

namespace helicarm::fiducials {
namespace {

using namespace label_scene;

LabellingProblem scene_of(const phantom::Calibrator& calibrator, const SyntheticImage& view_image) {
  LabellingProblem scene;
  for (const auto& ball : calibrator.balls)
    scene.balls.push_back({ball.centre_in_calibrator, ball.diameter_mm / 2});
  scene.candidates = view_image.candidates;
  scene.camera = {*nominal.focal_px, 0.01, nominal.principal_px, 30};
  scene.field_radius_px = nominal.field_radius_px;
  scene.radius_bias = 0;
  scene.radius_bias_sigma = 0.03;
  return scene;
}

/// Scalar reference in double precision: number of balls with a candidate within `reach` rough gates; -1 if
/// the pose does not exist or a radius contradicts it.
int support(const LabellingProblem& scene, const std::array<int, 3>& candidates, const PoseHypothesis& pose,
            double reach, double radius_sigmas) {
  std::array<Eigen::Vector2d, 3> image;
  std::array<Eigen::Vector3d, 3> points;
  for (int i = 0; i < 3; ++i) {
    image[i] = (scene.candidates[candidates[i]].uv - scene.camera.principal_px) / scene.camera.focal_px;
    if (pose.mirrored) image[i].x() *= -1;
    points[i] = scene.balls[pose.balls[i]].centre;
  }
  const auto triangle = model_triangle(pose.balls, points);
  if (!triangle) return -1;
  const Eigen::Vector2d e1 = image[1] - image[0];
  const Eigen::Vector2d e2 = image[2] - image[0];
  Orthography start = orthography(*triangle, e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2));
  start.behind1 *= pose.depth_sign;
  start.behind2 *= pose.depth_sign;
  const std::array<double, 3> behind{0, start.behind1, start.behind2};
  const double mm_per_px = 1 / std::sqrt(start.inverse_distance2) / scene.camera.focal_px;
  for (int i = 0; i < 3; ++i) {
    const Scale scale =
        scale_by_radius(scene, scene.candidates[candidates[i]], scene.balls[pose.balls[i]], radius_sigmas);
    if (!scale.holds(mm_per_px * (1 + behind[i]))) return -1;
  }
  const auto depths = three_point_depths(*triangle, image, start);
  if (!depths) return -1;
  const double fx = pose.mirrored ? -scene.camera.focal_px : scene.camera.focal_px;
  const geometry::View view{
      {fx, scene.camera.focal_px, scene.camera.principal_px.x(), scene.camera.principal_px.y()},
      three_point_pose(*triangle, image, *depths)};
  int near = 0;
  for (const auto& ball : scene.balls) {
    const Eigen::Vector2d uv = view.project(ball.centre);
    near += std::any_of(scene.candidates.begin(), scene.candidates.end(), [&](const BallCandidate& c) {
      return (c.uv - uv).norm() < reach * rough_gate_px(scene);
    });
  }
  return near;
}

TEST(HypothesisFilter, PassesTheSamePosesAsTheScalarReference) {
  constexpr int required = 6;
  int passed = 0;
  for (int trial = 0; trial < 6; ++trial) {
    RandomStream random(6, 1, trial);
    const phantom::Calibrator calibrator = trial % 2 == 0 ? helix() : scattered(9, 3);
    const auto view_image = image_of(calibrator, {.outliers = 6, .noise_px = 0.3}, random);
    const LabellingProblem scene = scene_of(calibrator, view_image);
    const std::array<int, 3> candidates{0, 3, 5};
    HypothesisFilter hypothesis_filter(scene);
    const auto filtered = hypothesis_filter.filter(candidates, scene.camera.focal_px, required);
    passed += static_cast<int>(filtered.size());
    for (const auto& pose : filtered) EXPECT_GE(support(scene, candidates, pose, 1.6, 3.1), required);
    const int balls = static_cast<int>(scene.balls.size());
    for (int code = 0; code < balls * balls * balls * 4; ++code) {
      const PoseHypothesis pose{{code / 4 % balls, code / 4 / balls % balls, code / 4 / balls / balls},
                                code % 2 ? -1.0 : 1.0,
                                code / 2 % 2 == 1};
      const auto& b = pose.balls;
      if (b[0] == b[1] || b[1] == b[2] || b[0] == b[2]) continue;
      if (support(scene, candidates, pose, 0.5, 2.9) < required) continue;
      EXPECT_TRUE(std::any_of(filtered.begin(), filtered.end(), [&](const PoseHypothesis& other) {
        return other.balls == b && other.depth_sign == pose.depth_sign && other.mirrored == pose.mirrored;
      }));
    }
  }
  EXPECT_GT(passed, 12);
}

TEST(HypothesisFilter, NoPosePassesWithoutSupport) {
  RandomStream random(6, 2);
  const auto view_image = image_of(helix(), {.noise_px = 0.3}, random);
  const LabellingProblem scene = scene_of(helix(), view_image);
  EXPECT_TRUE(HypothesisFilter(scene).filter({0, 1, 2}, scene.camera.focal_px, 13).empty());
}

}  // namespace
}  // namespace helicarm::fiducials
