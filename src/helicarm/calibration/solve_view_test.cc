// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/solve_view.h"

#include <cmath>
#include <string>

#include <Eigen/Geometry>
#include <gmock/gmock.h>

#include "helicarm/core/random.h"

namespace helicarm::calibration {
namespace solve_view_test {

using testing::HasSubstr;

const PointsOrigin origin{"points.csv", "x_mm, y_mm and z_mm"};

geometry::View true_view() {
  geometry::View view;
  view.intrinsics = {2500, 2510, 260, 250, 0};
  view.camera_from_world = {
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 0.5).normalized()).toRotationMatrix(), {5, -3, 900}};
  return view;
}

/// Of `unit` mm each, with noise of `sigma_px`.
std::vector<fiducials::Fiducial> points(double sigma_px, double unit = 1) {
  RandomStream random(6, 0);
  std::vector<fiducials::Fiducial> made;
  for (int i = 0; i < 14; ++i) {
    fiducials::Fiducial& point = made.emplace_back();
    point.label = "P" + std::to_string(i);
    point.status = fiducials::FiducialStatus::used;
    point.centre_in_calibrator = 40 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    point.uv = true_view().project(point.centre_in_calibrator);
    for (double& pixel : point.uv) pixel += sigma_px * random.normal();
    point.sigma_px = 0.1;
    point.centre_in_calibrator /= unit;
  }
  return made;
}

TEST(SolveView, EveryMethodFindsTheCameraOfExactPoints) {
  for (const char* word : {"ml", "dlt", "homogeneous"}) {
    const auto solved = solve_view(points(0), *solve_method(word, "method"), false, origin);
    ASSERT_TRUE(solved.has_value()) << word;
    EXPECT_LT((solved->view.source_in_world() - true_view().source_in_world()).norm(), 1e-3) << word;
    EXPECT_EQ(solved->covariance.has_value(), std::string(word) == "ml");
    EXPECT_TRUE(solved->warnings.empty()) << word;
  }
}

TEST(SolveView, SigmasThatAreNotGivenFollowFromTheResiduals) {
  const auto given = solve_view(points(0.1), SolveMethod::most_likely, true, origin);
  const auto estimated = solve_view(points(0.1), SolveMethod::most_likely, false, origin);
  const auto of_noisier = solve_view(points(0.2), SolveMethod::most_likely, false, origin);
  EXPECT_NEAR(std::sqrt(estimated->covariance->trace() / given->covariance->trace()), 1, 0.4);
  EXPECT_NEAR(std::sqrt(of_noisier->covariance->trace() / estimated->covariance->trace()), 2, 0.1);
}

TEST(SolveView, APointThatDoesNotFitIsNamed) {
  for (const auto& [off_px, words] :
       {std::pair(3.0, "times the stated sigma_px"), std::pair(60.0, "over 5 px")}) {
    auto all = points(0.05);
    all[4].uv.x() += off_px;
    const auto solved = solve_view(all, SolveMethod::most_likely, true, origin);
    ASSERT_EQ(solved->warnings.size(), 1u);
    EXPECT_EQ(solved->warnings[0].reason, Reason::residual_too_large);
    EXPECT_THAT(solved->warnings[0].message, HasSubstr(words));
    EXPECT_THAT(solved->warnings[0].message, HasSubstr("(P4)"));
  }
}

TEST(SolveView, PlacesInCmAreRefused) {
  const auto solved = solve_view(points(0, 10), SolveMethod::dlt, false, origin);
  ASSERT_FALSE(solved.has_value());
  EXPECT_EQ(solved.error().reason, Reason::usage);
  EXPECT_THAT(solved.error().message, HasSubstr("points.csv: in mm the source lies"));
}

TEST(SolveView, AnotherMethodIsRefused) {
  EXPECT_EQ(solve_method("mle", "--method").error().message,
            "--method: \"mle\" is none of: dlt, homogeneous, ml");
}

}  // namespace solve_view_test
}  // namespace helicarm::calibration
