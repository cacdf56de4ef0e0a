// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/fit_map.h"

#include <cmath>
#include <functional>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/rectification/models/kriging.h"
#include "helicarm/rectification/models/monomials.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;
using Bend = std::function<Vector2d(const Vector2d&)>;

constexpr int side = 512;

/// Plate of n x n dots, 2 px per mm, rotated by 0.1 rad; `bend` acts on (-1 .. 1)^2, in px.
std::vector<Correspondence> plate(int n, const Bend& bend, double noise = 0, std::uint64_t seed = 1) {
  RandomStream random(seed, 3);
  std::vector<Correspondence> dots;
  const double pitch = 220.0 / (n - 1);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Vector2d place = pitch * Vector2d(i - 0.5 * (n - 1), j - 0.5 * (n - 1));
      const Vector2d raw = Vector2d(255.5, 255.5) + 2 * (Eigen::Rotation2Dd(0.1) * place) +
                           bend(place / 110) + noise * Vector2d(random.normal(), random.normal());
      dots.push_back({place, raw, 0.05});
    }
  return dots;
}

Vector2d straight(const Vector2d&) { return Vector2d::Zero(); }
Vector2d pincushion(const Vector2d& t) { return 6 * t.squaredNorm() * t; }
Vector2d bumpy(const Vector2d& t) {
  return pincushion(t) + std::exp(-(t - Vector2d(0.3, -0.2)).squaredNorm() / 0.1) * Vector2d(0.8, -0.5);
}

MapOptions fixed(int order) {
  MapOptions options;
  options.order = order;
  options.reject_outliers = false;
  return options;
}

double rms(const Eigen::VectorXd& values) { return std::sqrt(values.squaredNorm() / double(values.size())); }

TEST(FitMap, ExactOnPolynomialData) {
  const auto dots = plate(7, pincushion);
  const auto fit = fit_map(dots, side, side, fixed(3));
  ASSERT_TRUE(fit);
  for (const Correspondence& dot : dots)
    EXPECT_LT((fit->map.raw_from_rectified(fit->rectified_from_plate * dot.place_mm) - dot.raw_px).norm(),
              1e-9);
  EXPECT_LT(fit->map.residual_max_px, 1e-9);
  EXPECT_LT(fit->map.held_out_rms_px, 1e-8);
}

TEST(FitMap, RectifiedDotsAreThePlateRotatedAndScaled) {
  const auto dots = plate(7, pincushion);
  const auto fit = fit_map(dots, side, side, fixed(3));
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->px_per_mm, 2, 1e-6);
  for (const Correspondence& dot : dots)
    EXPECT_LT((*fit->map.rectified_from_raw(dot.raw_px) - fit->rectified_from_plate * dot.place_mm).norm(),
              1e-8);
}

TEST(FitMap, RawScaleAndNoRotationAtTheCentre) {
  const auto fit = fit_map(plate(7, pincushion), side, side, fixed(3));
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->map.jacobian({255.5, 255.5}) - Eigen::Matrix2d::Identity()).norm(), 1e-6);
  EXPECT_LT((fit->map.raw_from_rectified({255.5, 255.5}) - Vector2d(255.5, 255.5)).norm(), 1e-6);
}

TEST(FitMap, RoundTripOfAFittedMapIsExact) {
  const auto fit = fit_map(plate(15, bumpy, 0.03), side, side, {});
  ASSERT_TRUE(fit);
  for (int v = 40; v < side; v += 36)
    for (int u = 40; u < side - 40; u += 36) {
      const auto rectified = fit->map.rectified_from_raw({u, v});
      ASSERT_TRUE(rectified);
      EXPECT_LT((fit->map.raw_from_rectified(*rectified) - Vector2d(u, v)).norm(), 1e-9);
    }
}

TEST(FitMap, HeldOutErrorEqualsRefitsWithoutEachDot) {
  auto dots = plate(7, bumpy, 0.05);
  for (std::size_t i = 0; i < dots.size(); ++i) dots[i].sigma_px = i % 3 == 0 ? 0.12 : 0.03;
  for (const int order : {1, 2, 3, 4}) {
    const auto fit = fit_map(dots, side, side, fixed(order));
    ASSERT_TRUE(fit);
    Eigen::VectorXd errors(dots.size());
    for (std::size_t out = 0; out < dots.size(); ++out) {
      Eigen::MatrixXd rows(dots.size(), term_count(order));
      Eigen::MatrixX2d raw(dots.size(), 2);
      for (std::size_t i = 0; i < dots.size(); ++i) {
        const double weight = i == out ? 0 : 1 / std::hypot(dots[i].sigma_px, 0.02);
        rows.row(Eigen::Index(i)) = weight * monomials(dots[i].place_mm / 110, order).transpose();
        raw.row(Eigen::Index(i)) = weight * dots[i].raw_px.transpose();
      }
      const Eigen::MatrixX2d coefficients = rows.colPivHouseholderQr().solve(raw);
      const Vector2d predicted = coefficients.transpose() * monomials(dots[out].place_mm / 110, order);
      errors[Eigen::Index(out)] = (dots[out].raw_px - predicted).norm();
    }
    EXPECT_NEAR(fit->map.held_out_rms_px / rms(errors), 1, 1e-8) << order;
  }
}

TEST(FitMap, ChoosesTheOrderOfTheData) {
  MapOptions options;
  options.model = "polynomial";
  const auto quadratic = [](const Vector2d& t) { return Vector2d(4 * t.x() * t.y(), 3 * t.x() * t.x()); };
  const auto model_of = [&](const Bend& bend) {
    return fit_map(plate(9, bend, 0.05), side, side, options)->map.model->name();
  };
  EXPECT_EQ(model_of(straight), "polynomial of order 1");
  EXPECT_EQ(model_of(quadratic), "polynomial of order 2");
  EXPECT_EQ(model_of(pincushion), "polynomial of order 3");
}

TEST(FitMap, QuadraticLeavesMostOfAPincushion) {
  const auto second = fit_map(plate(7, pincushion), side, side, fixed(2));
  ASSERT_TRUE(second);
  EXPECT_GT(second->map.residual_rms_px, 0.5);
}

TEST(FitMap, RemainderFollowsALocalBump) {
  MapOptions plain;
  plain.model = "polynomial";
  const auto dots = plate(15, bumpy, 0.03);
  const auto polynomial = fit_map(dots, side, side, plain);
  const auto full = fit_map(dots, side, side, {});
  ASSERT_TRUE(polynomial && full);
  EXPECT_EQ(full->map.model->name(), "polynomial of order 3, smooth remainder");
  EXPECT_LT(full->map.held_out_rms_px, 0.9 * polynomial->map.held_out_rms_px);
  double most = 0;
  for (const Correspondence& dot : plate(24, bumpy))
    most = std::max(
        most, (full->map.raw_from_rectified(full->rectified_from_plate * dot.place_mm) - dot.raw_px).norm());
  EXPECT_LT(most, 0.1);
}

/// Displacements (px, both axes) from a Matern field of the given length at positions in (-1 .. 1)^2.
Eigen::MatrixX2d drawn_field(const std::vector<Vector2d>& places, double length, double sigma,
                             RandomStream& random) {
  const auto n = static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      covariance(i, j) =
          sigma * sigma * kernel((places[std::size_t(i)] - places[std::size_t(j)]).squaredNorm(), length);
  covariance.diagonal().array() += 1e-10;
  const Eigen::MatrixX2d white = Eigen::MatrixX2d::NullaryExpr(n, 2, [&] { return random.normal(); });
  return covariance.llt().matrixL() * white;
}

TEST(FitMap, ErrorBetweenDotsAgreesWithTheReportedSigma) {
  constexpr int draws = 40;
  const auto dots = plate(7, pincushion);
  const auto between = plate(6, pincushion);
  std::vector<Vector2d> places;
  for (const auto* of : {&dots, &between})
    for (const Correspondence& dot : *of) places.push_back(dot.place_mm / 110);
  RandomStream random(11, 1);
  double chi2 = 0;
  for (int draw = 0; draw < draws; ++draw) {
    const Eigen::MatrixX2d field = drawn_field(places, 0.5, 0.4, random);
    auto seen = dots;
    for (std::size_t i = 0; i < seen.size(); ++i)
      seen[i].raw_px +=
          field.row(Eigen::Index(i)).transpose() + 0.05 * Vector2d(random.normal(), random.normal());
    const auto fit = fit_map(seen, side, side, {});
    ASSERT_TRUE(fit);
    for (std::size_t i = 0; i < between.size(); ++i) {
      const Vector2d truth = between[i].raw_px + field.row(Eigen::Index(dots.size() + i)).transpose();
      const Vector2d rectified = fit->rectified_from_plate * between[i].place_mm;
      chi2 += (fit->map.raw_from_rectified(rectified) - truth).squaredNorm() /
              std::pow(fit->map.sigma_px(rectified), 2);
    }
  }
  const double z = std::sqrt(chi2 / (2.0 * draws * double(between.size())));
  EXPECT_GT(z, 0.85);
  EXPECT_LT(z, 1.15);
}

TEST(FitMap, FarFromDotsTheRemainderHasItsPriorUncertainty) {
  const auto fit = fit_map(plate(7, bumpy, 0.05), side, side, {});
  ASSERT_TRUE(fit);
  const double at_a_dot = fit->map.sigma_px(fit->rectified_from_plate * Vector2d(0, 0));
  const double between = fit->map.sigma_px(fit->rectified_from_plate * Vector2d(18, 18));
  const double outside = fit->map.sigma_px(fit->rectified_from_plate * Vector2d(180, 0));
  EXPECT_LT(at_a_dot, between);
  EXPECT_GT(outside, 5 * between);
}

TEST(FitMap, ErrorIsCorrelatedWithNeighbouringDots) {
  const auto fit = fit_map(plate(7, bumpy, 0.05), side, side, {});
  ASSERT_TRUE(fit);
  std::vector<Vector2d> places;
  for (const double x : {17.0, 19.0, -90.0}) places.push_back(fit->rectified_from_plate * Vector2d(x, 18));
  const Eigen::MatrixXd covariance = fit->map.covariance_px2(places);
  EXPECT_NEAR(std::sqrt(covariance(0, 0)) / fit->map.sigma_px(places[0]), 1, 1e-9);
  EXPECT_GT(covariance(0, 1), 0.8 * covariance(0, 0));
  EXPECT_LT(std::abs(covariance(0, 2)), 0.3 * covariance(0, 0));
}

TEST(FitMap, OnlyOutliersAreRejected) {
  auto dots = plate(7, pincushion, 0.04);
  dots[10].raw_px += Vector2d(4, -3);
  dots[37].raw_px += Vector2d(-1.5, 0.5);
  const auto fit = fit_map(dots, side, side, {});
  ASSERT_TRUE(fit);
  for (std::size_t i = 0; i < dots.size(); ++i) EXPECT_EQ(fit->used[i], i != 10 && i != 37) << i;
  EXPECT_NEAR(fit->residual_px[10], 5, 0.3);
  EXPECT_LT(fit->map.residual_max_px, 0.2);
}

TEST(FitMap, KeepsOutliersIfRequested) {
  auto dots = plate(7, pincushion);
  dots[10].raw_px += Vector2d(4, -3);
  const auto fit = fit_map(dots, side, side, fixed(3));
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->used[10]);
}

TEST(FitMap, TooFewDotsAreRefused) {
  auto dots = plate(7, straight);
  const auto refusal = [&](std::size_t count, const MapOptions& options) {
    return fit_map({dots.begin(), dots.begin() + std::ptrdiff_t(count)}, side, side, options).error().reason;
  };
  EXPECT_EQ(refusal(0, {}), Reason::plate_not_found);
  EXPECT_EQ(refusal(5, {}), Reason::plate_not_found);
  EXPECT_EQ(refusal(11, fixed(3)), Reason::plate_not_found);
}

TEST(FitMap, DotsOnOneLineAreRefused) {
  const auto dots = plate(7, straight);
  std::vector<Correspondence> row(dots.begin(), dots.begin() + 7);
  const auto fit = fit_map(row, side, side, {});
  ASSERT_FALSE(fit);
  EXPECT_EQ(fit.error().reason, Reason::plate_not_found);
}

TEST(FitMap, DotsInOnePlaceAreRefused) {
  const std::vector<Correspondence> same(20, {{3, 4}, {100, 100}, 0.05});
  EXPECT_EQ(fit_map(same, side, side, {}).error().reason, Reason::plate_not_found);
}

TEST(FitMap, SigmaCoversTheErrorOfTheMap) {
  const auto exact = plate(24, pincushion);
  double squares = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const auto fit = fit_map(plate(7, pincushion, 0.08, seed), side, side, fixed(3));
    ASSERT_TRUE(fit);
    for (std::size_t i = 0; i < exact.size(); i += 7) {
      const Vector2d rectified = fit->rectified_from_plate * exact[i].place_mm;
      const double sigma = fit->map.sigma_px(rectified);
      squares +=
          (fit->map.raw_from_rectified(rectified) - exact[i].raw_px).squaredNorm() / (2 * sigma * sigma);
      ++count;
    }
  }
  const double ratio = std::sqrt(squares / count);
  EXPECT_GT(ratio, 0.8);
  EXPECT_LT(ratio, 1.25);
}

TEST(FitMap, HullContainsTheUsedDots) {
  const auto fit = fit_map(plate(7, straight), side, side, fixed(1));
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->map.hull_low - fit->rectified_from_plate * Vector2d(-110, 110)).x(), 1e-9);
  for (const Correspondence& dot : plate(7, straight)) {
    const Vector2d p = fit->rectified_from_plate * dot.place_mm;
    EXPECT_TRUE((p.array() >= fit->map.hull_low.array() - 1e-9).all() &&
                (p.array() <= fit->map.hull_high.array() + 1e-9).all());
  }
}

}  // namespace
}  // namespace helicarm::rectification
