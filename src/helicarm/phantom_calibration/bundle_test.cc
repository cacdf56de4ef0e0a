// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/bundle.h"

#include <Eigen/Eigenvalues>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/gauge.h"
#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr double sigma_px = 0.05;

/// Of the centres, in the similarity frame that fits the truth best: squared Mahalanobis distance.
double chi2_of(const BundleFit& fit, const std::vector<Eigen::Vector3d>& truth) {
  const auto n = Eigen::Index(truth.size());
  const Similarity s = similarity_between(fit.centres, truth, Eigen::VectorXd::Ones(n), true);
  Eigen::VectorXd error(3 * n);
  for (Eigen::Index i = 0; i < n; ++i)
    error.segment<3>(3 * i) =
        fit.centres[std::size_t(i)] -
        s.a_from_b.rotation.transpose() * (truth[std::size_t(i)] - s.a_from_b.translation) / s.scale;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(fit.covariance_mm2);
  const Eigen::VectorXd along = eigen.eigenvectors().transpose() * error;
  double sum = 0;  // the first seven are the gauge
  for (Eigen::Index i = 7; i < 3 * n; ++i) sum += along[i] * along[i] / eigen.eigenvalues()[i];
  return sum;
}

TEST(Bundle, SixViewsFindTheCentresWithinTheirCovariance) {
  const std::vector<Eigen::Vector3d> truth = helix_centres();
  double sum = 0;
  int dof = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const BundleProblem problem = synthetic_problem(truth, 6, sigma_px, seed);
    const auto fit = adjust(problem);
    ASSERT_TRUE(fit) << fit.error().message;
    EXPECT_LT(fit->chi2 / fit->dof, 1.6);
    sum += chi2_of(*fit, truth);
    dof += 3 * 12 - 7;
  }
  EXPECT_NEAR(sum / dof, 1, 0.3);
}

TEST(Bundle, InnerConstraintsLeaveNoCovarianceAlongTheGauge) {
  const auto fit = adjust(synthetic_problem(helix_centres(), 4, sigma_px, 3));
  ASSERT_TRUE(fit) << fit.error().message;
  const Eigen::MatrixXd motions = similarity_motions(fit->centres);
  EXPECT_LT((motions.transpose() * fit->covariance_mm2 * motions).norm() / motions.squaredNorm(),
            1e-9 * fit->covariance_mm2.trace());
}

TEST(Bundle, OneMovedImageHasTheLargestFall) {
  BundleProblem problem = synthetic_problem(helix_centres(), 6, sigma_px, 5);
  problem.views[2].images[4].uv.x() += 1;
  const auto fit = adjust(problem);
  ASSERT_TRUE(fit) << fit.error().message;
  double largest = 0;
  for (const auto& of_view : fit->falls)
    for (const double fall : of_view) largest = std::max(largest, fall);
  EXPECT_GT(largest, 50);
  EXPECT_EQ(fit->falls[2][4], largest);
}

TEST(Bundle, RobustLossBearsAThirdOfAViewMislabelled) {
  BundleProblem problem = synthetic_problem(helix_centres(), 6, sigma_px, 7);
  for (std::size_t i = 0; i < 4; ++i) problem.views[1].images[i].uv += Eigen::Vector2d(30, -20);
  BundleOptions robust;
  robust.robust = true;
  const auto fit = adjust(problem, robust);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_GT(fit->residuals_px[1][0].norm(), 20);
  EXPECT_LT(fit->residuals_px[1][8].norm(), 1);
}

TEST(Bundle, TwoViewsWithKnownIntrinsicsAreEnough) {
  EXPECT_TRUE(adjust(synthetic_problem(helix_centres(), 2, sigma_px, 9)));
}

TEST(Bundle, CovarianceThatIsNotPositiveIsUncertain) {
  BundleProblem problem = synthetic_problem(helix_centres(), 3, sigma_px, 9);
  const auto n = Eigen::Index(problem.views[1].images.size());
  problem.views[1].map_covariance_px2 = -Eigen::MatrixXd::Identity(n, n);
  const auto fit = adjust(problem);
  ASSERT_FALSE(fit);
  EXPECT_EQ(fit.error().reason, Reason::uncertain);
  EXPECT_THAT(fit.error().message, testing::HasSubstr(problem.views[1].name));
}

TEST(Bundle, ViewWithoutImagesIsUncertain) {
  BundleProblem problem = synthetic_problem(helix_centres(), 4, 0.05, 3);
  problem.views[2].images.clear();
  for (const bool robust : {false, true}) {
    BundleOptions options;
    options.robust = robust;
    const auto fit = adjust(problem, options);
    ASSERT_FALSE(fit);
    EXPECT_EQ(fit.error().reason, Reason::uncertain);
  }
}

}  // namespace
}  // namespace helicarm::phantom_calibration
