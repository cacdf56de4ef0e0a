// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/least_squares.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

using Equations = std::optional<NormalEquations<2>>;

/// NIST StRD nonlinear regression "Misra1a": y = b1 (1 - exp(-b2 x)).
constexpr std::array<std::array<double, 2>, 14> misra1a{{{77.6, 10.07},
                                                         {114.9, 14.73},
                                                         {141.1, 17.94},
                                                         {190.8, 23.93},
                                                         {239.9, 29.61},
                                                         {289.0, 35.18},
                                                         {332.8, 40.02},
                                                         {378.4, 44.82},
                                                         {434.8, 50.76},
                                                         {477.3, 55.05},
                                                         {536.8, 61.01},
                                                         {593.1, 66.40},
                                                         {689.1, 75.47},
                                                         {760.0, 81.78}}};

Equations linearise_misra1a(const Eigen::Vector2d& b) {
  NormalEquations<2> equations{Eigen::Matrix2d::Zero(), Eigen::Vector2d::Zero()};
  for (const auto& [x, y] : misra1a) {
    const double left = std::exp(-b[1] * x);
    const Eigen::Vector2d slope(1 - left, b[0] * x * left);
    const double residual = y - b[0] * (1 - left);
    equations.information += slope * slope.transpose();
    equations.gradient += slope * residual;
    equations.chi2 += residual * residual;
  }
  return equations;
}

Eigen::Vector2d added(const Eigen::Vector2d& b, const Eigen::Vector2d& step) { return b + step; }

TEST(LeastSquares, CertifiedParametersAreFoundFromADistantStart) {
  const auto fit = fit_least_squares(Eigen::Vector2d(500, 1e-4), linearise_misra1a, added);
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->converged);
  EXPECT_NEAR(fit->state[0], 2.3894212918e2, 1e-6);
  EXPECT_NEAR(fit->state[1], 5.5015643181e-4, 2e-12);
  EXPECT_NEAR(fit->equations.chi2, 1.2455138894e-1, 1e-11);
}

TEST(LeastSquares, StandardErrorsFollowFromTheInformation) {
  const auto fit = fit_least_squares(Eigen::Vector2d(250, 5e-4), linearise_misra1a, added);
  ASSERT_TRUE(fit);
  const Eigen::Matrix2d covariance = fit->equations.information.inverse() * fit->equations.chi2 / 12;
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 2.7070075241, 1e-6);
  EXPECT_NEAR(std::sqrt(covariance(1, 1)), 7.2668688436e-6, 1e-12);
}

TEST(LeastSquares, AStartThatIsNotAllowedGivesNothing) {
  EXPECT_FALSE(fit_least_squares(
      Eigen::Vector2d::Zero().eval(), [](const Eigen::Vector2d&) { return Equations{}; }, added));
}

TEST(LeastSquares, AStepToAStateThatIsNotAllowedIsShortened) {
  // ln x = 0 from x = 5, whose full step leads to x < 0.
  const auto linearise = [](double x) -> std::optional<NormalEquations<1>> {
    if (!(x > 0)) return std::nullopt;
    const double slope = 1 / x, residual = -std::log(x);
    return NormalEquations<1>{Eigen::Matrix<double, 1, 1>(slope * slope),
                              Eigen::Matrix<double, 1, 1>(slope * residual), residual * residual};
  };
  const auto moved = [](double x, const Eigen::Matrix<double, 1, 1>& step) { return x + step[0]; };
  const auto fit = fit_least_squares(5.0, linearise, moved);
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->converged);
  EXPECT_NEAR(fit->state, 1, 1e-6);
}

TEST(LeastSquares, TheIterationLimitIsReported) {
  LeastSquaresOptions options;
  options.max_iterations = 2;
  const auto fit = fit_least_squares(Eigen::Vector2d(500, 1e-4), linearise_misra1a, added, options);
  ASSERT_TRUE(fit);
  EXPECT_FALSE(fit->converged);
}

}  // namespace
}  // namespace helicarm::geometry
