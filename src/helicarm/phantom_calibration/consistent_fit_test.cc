// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/consistent_fit.h"

#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr double noise_px = 0.05;
constexpr double least_mm = 0.4;

/// Fiducial 5's image in a view, as if it had been `by` away.
void move(BundleProblem& problem, std::size_t view, const Eigen::Vector3d& by) {
  const geometry::View& pose = problem.views[view].start;
  FiducialImage& image = problem.views[view].images[5];
  image.uv += pose.project(problem.centres[5] + by) - pose.project(problem.centres[5]);
}

TEST(ConsistentFit, GoodImagesAreKept) {
  const auto fit = adjust_without_outliers(synthetic_problem(helix_centres(), 5, noise_px, 1));
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_TRUE(fit->rejected.empty());
  EXPECT_FALSE(moved_fiducial(*fit, least_mm));
}

TEST(ConsistentFit, FiducialThatMovedBeforeTheLastTwoViewsIsNamedWithItsMotion) {
  BundleProblem problem = synthetic_problem(helix_centres(), 6, noise_px, 2);
  for (const std::size_t view : {4u, 5u}) move(problem, view, {0.6, -0.8, 0.5});
  const auto fit = adjust_without_outliers(std::move(problem));
  ASSERT_TRUE(fit) << fit.error().message;
  const auto moved = moved_fiducial(*fit, least_mm);
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->fiducial, 5u);
  EXPECT_EQ(moved->views.size(), 2u);
  EXPECT_NEAR(moved->moved_mm, std::sqrt(1.25), 0.2);
}

TEST(ConsistentFit, SingleDisturbedImageBetweenOthersIsNoMotion) {
  BundleProblem problem = synthetic_problem(helix_centres(), 6, noise_px, 2);
  move(problem, 3, {0.6, -0.8, 0.5});
  const auto fit = adjust_without_outliers(std::move(problem));
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_EQ(fit->rejected.size(), 1u);
  EXPECT_FALSE(moved_fiducial(*fit, least_mm));
}

TEST(ConsistentFit, MotionBelowTheLimitIsNoRefusal) {
  BundleProblem problem = synthetic_problem(helix_centres(), 6, noise_px, 3);
  move(problem, 5, {0.1, 0.1, 0});
  const auto fit = adjust_without_outliers(std::move(problem));
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_EQ(fit->rejected.size(), 1u);
  EXPECT_FALSE(moved_fiducial(*fit, least_mm));
}

TEST(ConsistentFit, ImagesOfAViewLeftOutArePredicted) {
  const auto fit = adjust_without_outliers(synthetic_problem(helix_centres(), 5, noise_px, 4));
  ASSERT_TRUE(fit) << fit.error().message;
  for (const auto& rms : left_out_rms(*fit, 1)) {
    ASSERT_TRUE(rms);
    EXPECT_LT(*rms, 4 * noise_px);
  }
}

}  // namespace
}  // namespace helicarm::phantom_calibration
