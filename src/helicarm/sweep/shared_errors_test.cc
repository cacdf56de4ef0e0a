// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/shared_errors.h"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>

namespace helicarm::sweep {
namespace {

/// The identity, with errors of 0.1 px that are alike over 80 px.
class DoubtfulModel : public rectification::DistortionModel {
 public:
  std::string name() const override { return "doubtful identity"; }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const override { return rectified; }
  Eigen::Matrix2d jacobian(const Eigen::Vector2d&) const override { return Eigen::Matrix2d::Identity(); }
  double extent_px() const override { return 100; }
  void write(Json&) const override {}
  Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> at) const override {
    const auto n = std::ssize(at);
    Eigen::MatrixXd covariance(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index k = 0; k < n; ++k)
        covariance(i, k) = 0.01 * std::exp(-(at[std::size_t(i)] - at[std::size_t(k)]).squaredNorm() / 6400);
    return covariance;
  }
};

FrameEstimate frame_with(rectification::ModelPointer model) {
  FrameEstimate frame;
  frame.map = rectification::identity_map(200, 200, 1.0);
  if (model) frame.map->model = std::move(model);
  return frame;
}

TEST(SharedMap, ErrorsOfAnyTwoFramesHaveTheMapsCovariance) {
  const std::vector frames{frame_with(std::make_shared<DoubtfulModel>())};
  constexpr double noise_factor = 1.5;
  const auto shared = shared_map_of(frames, noise_factor);
  ASSERT_TRUE(shared);
  const std::vector<Eigen::Vector2d> first{{60, 70}, {150, 40}}, second{{90, 100}};
  const Eigen::MatrixXd between = shared->errors_at(first) * shared->errors_at(second).transpose();
  std::vector<Eigen::Vector2d> all = first;
  all.push_back(second.front());
  const Eigen::MatrixXd expected = frames[0].map->covariance_px2(all) * noise_factor * noise_factor;
  EXPECT_NEAR(between(0, 0), expected(0, 2), 0.02 * expected(0, 0));
  EXPECT_NEAR(between(1, 0), expected(1, 2), 0.02 * expected(0, 0));
}

TEST(SharedMap, RunsWithoutAMapOrWithAnExactOneShareNone) {
  EXPECT_FALSE(shared_map_of({FrameEstimate{}}, 1));
  EXPECT_FALSE(shared_map_of({frame_with(nullptr)}, 1));
  std::vector refused{frame_with(std::make_shared<DoubtfulModel>())};
  refused[0].failure = Failure{Reason::blank_image, "", {}, {}};
  EXPECT_FALSE(shared_map_of(refused, 1));
}

}  // namespace
}  // namespace helicarm::sweep
