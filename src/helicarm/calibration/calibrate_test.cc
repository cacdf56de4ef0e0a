// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/calibrate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"

namespace helicarm::calibration {
namespace {

std::vector<ViewFiducials> pair_of_views(double sigma, std::uint64_t trial) {
  RandomStream random(11, 0, trial);
  return {observed_fiducials("AP", paper_view(0), sigma, random),
          observed_fiducials("LAT", paper_view(std::numbers::pi / 2), sigma, random)};
}

TEST(Calibrate, NearlyExactImagesRecoverTheViews) {
  auto views = pair_of_views(1e-6, 0);
  const auto result = calibrate(views, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_NEAR(result->views[0].view.intrinsics.fx, 6000, 1e-2);
  EXPECT_NEAR(result->views[1].view.camera_from_world.translation.z(), 800, 1e-2);
  EXPECT_LT(result->views[1].reprojection_rms_px, 1e-5);
  EXPECT_TRUE(result->warnings.empty());
}

TEST(Calibrate, MirroredViewKeepsItsHandedness) {
  RandomStream random(12, 0);
  geometry::View mirrored = paper_view(0.4);
  mirrored.intrinsics.fx *= -1;
  const auto result = calibrate({observed_fiducials("AP", mirrored, 0.1, random)}, {});
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(result->views[0].view.intrinsics.fx, -5000);
  EXPECT_GT(result->views[0].view.camera_from_world.rotation.determinant(), 0);
}

class ScatterWithTolerance : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Calibrate, ScatterWithTolerance, testing::Values(0, 0.02));

TEST_P(ScatterWithTolerance, EqualsTheJointCovariance) {
  const double tolerance_mm = GetParam();
  CalibrationOptions options;
  options.rejection_probability = 0;
  const int trials = 400;
  double distance2 = 0, chi2 = 0, dof = 0;
  for (int trial = 0; trial < trials; ++trial) {
    auto views = pair_of_views(0.2, std::uint64_t(trial));
    RandomStream random(13, 0, std::uint64_t(trial));
    const double common = 5 * random.normal();
    options.common = {{IntrinsicsVariation{5, 3}, IntrinsicsVariation{8, 4}}};
    const Eigen::Vector3d per_axis_mm = tolerance_mm * Eigen::Vector3d(1, 2, 0.5);
    if (tolerance_mm > 0) options.common.ball_covariance_mm2.assign(12, per_axis_mm.cwiseAbs2().asDiagonal());
    const auto near = [&](double value, double sigma) { return value + sigma * random.normal(); };
    const auto near_pixel = [&](const Eigen::Vector2d& pixel, double sigma) {
      return Eigen::Vector2d(pixel + sigma * normal_2(random));
    };
    const Eigen::Vector2d middle = near_pixel({512, 512}, 8);
    for (auto& view : views)
      view.prior = {near(6000 + common, 3), near_pixel(middle, 4), 1,
                    geometry::NormalPrior{near(1, 1e-3), 1e-3}, geometry::NormalPrior{near(0, 1e-3), 1e-3}};
    for (std::size_t k = 0; k < 12; ++k) {
      const Eigen::Vector3d off = per_axis_mm.cwiseProduct(normal_3(random));
      for (auto& view : views) view.fiducials[k].centre_in_calibrator += off;
    }
    const auto result = calibrate(views, options);
    ASSERT_TRUE(result.has_value());
    Eigen::VectorXd error(2 * view_parameters);
    for (int i = 0; i < 2; ++i) {
      const geometry::View& view = result->views[std::size_t(i)].view;
      const geometry::View truth = paper_view(i == 0 ? 0 : std::numbers::pi / 2);
      const geometry::Intrinsics& k = view.intrinsics;
      error.segment<view_parameters>(Eigen::Index(view_parameters) * i) << k.fx - 6000, k.fy - 6000,
          k.u0 - 512, k.v0 - 512,
          geometry::vector_from_rotation(view.camera_from_world.rotation *
                                         truth.camera_from_world.rotation.transpose()),
          view.camera_from_world.translation - truth.camera_from_world.translation, k.skew;
    }
    distance2 += error.dot(result->joint_covariance.ldlt().solve(error)) / trials;
    chi2 += result->chi2 / trials;
    dof += double(result->dof) / trials;
  }
  EXPECT_NEAR(distance2, 22, 1.3);
  EXPECT_NEAR(chi2 / dof, 1, 0.04);
}

TEST(Calibrate, ErrorOfTheScaleIsOneNumberSharedByAllViews) {
  const double scale_sigma = 0.02, scale = 1 + 1e-4;
  const auto views = pair_of_views(0.2, 3);
  const auto exact = calibrate(views, {});
  CalibrationOptions options;
  options.common.scale_sigma = scale_sigma;
  const auto uncertain = calibrate(views, options);
  ASSERT_TRUE(exact && uncertain);
  auto larger = views;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const fiducials::Fiducial& f : views[0].fiducials) mean += f.centre_in_calibrator / 12;
  for (auto& view : larger)
    for (fiducials::Fiducial& f : view.fiducials)
      f.centre_in_calibrator = mean + scale * (f.centre_in_calibrator - mean);
  const auto scaled = calibrate(larger, {});
  ASSERT_TRUE(scaled);
  Eigen::VectorXd change = Eigen::VectorXd::Zero(Eigen::Index{2} * view_parameters);
  for (int i = 0; i < 2; ++i)
    change.segment<3>(view_parameters * i + 7) =
        (scaled->views[std::size_t(i)].view.camera_from_world.translation -
         exact->views[std::size_t(i)].view.camera_from_world.translation) /
        (scale - 1);
  const Eigen::MatrixXd added = uncertain->joint_covariance - exact->joint_covariance;
  const Eigen::MatrixXd expected = scale_sigma * scale_sigma * change * change.transpose();
  EXPECT_LT((added - expected).norm(), 1e-3 * expected.norm());
}

TEST(Calibrate, CorrelatedErrorsOfTheMapAreInTheCovariance) {
  CalibrationOptions options;
  options.rejection_probability = 0;
  const double own = 0.05, map = 0.2, reach_px = 150;
  const int trials = 300;
  double together = 0, alone = 0;
  for (int trial = 0; trial < trials; ++trial) {
    auto views = pair_of_views(own, std::uint64_t(trial));
    RandomStream random(16, 0, std::uint64_t(trial));
    for (auto& view : views) {
      const auto n = Eigen::Index(view.fiducials.size());
      Eigen::MatrixXd covariance(n, n);
      for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < n; ++j)
          covariance(i, j) =
              map * map *
              std::exp(-0.5 *
                       (view.fiducials[std::size_t(i)].uv - view.fiducials[std::size_t(j)].uv).squaredNorm() /
                       (reach_px * reach_px));
      const Eigen::MatrixXd root = covariance.llt().matrixL();
      for (int axis = 0; axis < 2; ++axis) {
        Eigen::VectorXd error(n);
        for (Eigen::Index i = 0; i < n; ++i) error(i) = random.normal();
        error = root * error;
        for (Eigen::Index i = 0; i < n; ++i) view.fiducials[std::size_t(i)].uv[axis] += error(i);
      }
      for (auto& f : view.fiducials) f.sigma_px = std::hypot(own, map);
      view.prior.aspect = geometry::NormalPrior{1, 1e-3};
      view.map_covariance_px2 = covariance;
    }
    const auto distance2 = [&] {
      const auto result = calibrate(views, options);
      EXPECT_TRUE(result.has_value());
      const geometry::View& view = result->views[0].view;
      Eigen::Vector3d error =
          view.project({0, 0, 40}).homogeneous() - paper_view(0).project({0, 0, 40}).homogeneous();
      const auto by_numbers = pixel_by_parameters(view, {0, 0, 40});
      const Eigen::Matrix2d noise = by_numbers * result->views[0].covariance * by_numbers.transpose();
      return error.head<2>().dot(noise.ldlt().solve(error.head<2>()));
    };
    together += distance2() / trials;
    for (auto& view : views) view.map_covariance_px2.resize(0, 0);
    alone += distance2() / trials;
  }
  EXPECT_NEAR(together, 2, 0.4);
  EXPECT_GT(alone, 4);  // with independent errors assumed
}

TEST(Calibrate, ConvergesWithoutAnyPriorInTheNoiseOfThePaper) {
  int done = 0;
  for (int trial = 0; trial < 200; ++trial) {
    RandomStream random(14, 0, std::uint64_t(trial));
    done += calibrate({observed_fiducials("AP", paper_view(0), 2.34, random)}, {}).has_value();
  }
  EXPECT_GE(done, 198);
}

TEST(Calibrate, OnlyOutliersAreRejected) {
  for (const auto& wrong : {std::vector<int>{3}, {3, 7}, {1, 2, 10}})
    for (double off : {2.0, 12.0}) {
      auto views = pair_of_views(0.1, 5);
      for (int k : wrong)
        views[1].fiducials[std::size_t(k)].uv += off * Eigen::Vector2d(0.6, k % 2 ? 0.8 : -0.8);
      const auto result = calibrate(views, {});
      ASSERT_TRUE(result.has_value()) << result.error().message;
      for (int v = 0; v < 2; ++v)
        for (int k = 0; k < 12; ++k) {
          const bool is_wrong = v == 1 && std::find(wrong.begin(), wrong.end(), k) != wrong.end();
          EXPECT_EQ(
              result->fiducials[std::size_t(v)][std::size_t(k)].status == fiducials::FiducialStatus::rejected,
              is_wrong)
              << wrong.size() << " balls off by " << off << ": view " << v << " ball " << k;
        }
      EXPECT_LT(result->views[1].reprojection_rms_px, 0.2);
    }
}

TEST(Calibrate, GrossOutlierIsRejected) {
  auto views = pair_of_views(0.1, 6);
  views[0].fiducials[4].uv += Eigen::Vector2d(90, -40);
  const auto result = calibrate(views, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(result->fiducials[0][4].status, fiducials::FiducialStatus::rejected);
  EXPECT_NEAR(result->fiducials[0][4].residual_px, 98, 3);
}

TEST(Calibrate, InliersAreKept) {
  int rejected = 0;
  for (int trial = 0; trial < 100; ++trial) {
    auto views = pair_of_views(0.3, std::uint64_t(trial));
    for (auto& view : views)
      for (auto& f : view.fiducials)
        f.sigma_px = trial % 2 ? 0.15 : 0.3;  // also if sigma is half the true one
    const auto result = calibrate(views, {});
    ASSERT_TRUE(result.has_value());
    for (const auto& fiducials : result->fiducials)
      for (const auto& f : fiducials) rejected += f.status == fiducials::FiducialStatus::rejected;
  }
  EXPECT_LE(rejected, 1);
}

TEST(Calibrate, InconsistentSigmasInflateTheCovarianceAndWarn) {
  auto views = pair_of_views(0.5, 1);
  for (auto& view : views)
    for (auto& f : view.fiducials) f.sigma_px = 0.1;
  const auto result = calibrate(views, {});
  ASSERT_TRUE(result.has_value());
  EXPECT_NEAR(result->variance_scale, 25, 15);
  ASSERT_EQ(result->warnings.size(), 1u);
  EXPECT_EQ(result->warnings[0].reason, Reason::residual_too_large);
}

/// Views of a calibrator that differs from the file by `place`.
std::vector<ViewFiducials> views_of_deviating_calibrator(
    const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& place, std::uint64_t trial,
    double sigma = 0.05) {
  auto views = pair_of_views(sigma, trial);
  RandomStream random(21, 0, trial);
  std::vector<Eigen::Vector3d> places;
  for (const fiducials::Fiducial& ball : views[0].fiducials)
    places.push_back(place(ball.centre_in_calibrator));
  for (std::size_t i = 0; i < 2; ++i) {
    const geometry::View view = paper_view(i == 0 ? 0 : std::numbers::pi / 2);
    views[i].prior = {6000, Eigen::Vector2d(512, 512), 1 / 0.15, geometry::NormalPrior{1, 1e-3},
                      geometry::NormalPrior{0, 1e-12}};
    for (std::size_t k = 0; k < places.size(); ++k)
      views[i].fiducials[k].uv = view.project(places[k]) + sigma * normal_2(random);
  }
  return views;
}

CalibrationOptions with_c_arm_prior() {
  CalibrationOptions options;
  options.common.c_arm = {IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}};
  return options;
}

bool warns(const CalibrationResult& result, Reason reason) {
  return std::ranges::any_of(result.warnings, [&](const Warning& w) { return w.reason == reason; });
}

TEST(Calibrate, ToleranceOfScatteredBallsIsEstimated) {
  for (std::uint64_t trial = 0; trial < 10; ++trial) {
    RandomStream random(22, 0, trial);
    const auto off = [&](const Eigen::Vector3d& place) -> Eigen::Vector3d {
      return place + 0.1 * normal_3(random);
    };
    const auto result = calibrate(views_of_deviating_calibrator(off, trial), with_c_arm_prior());
    ASSERT_TRUE(result.has_value()) << result.error().message;
    EXPECT_GT(result->found_tolerance_mm, 0.04) << trial;
    EXPECT_LT(result->found_tolerance_mm, 0.25) << trial;
    EXPECT_TRUE(warns(*result, Reason::calibrator_deviates)) << trial;
    EXPECT_EQ(result->variance_scale, 1) << trial;
  }
}

TEST(Calibrate, ExactCalibratorIsNeitherOffsetNorStrained) {
  for (std::uint64_t trial = 0; trial < 30; ++trial) {
    const auto same = [](const Eigen::Vector3d& place) { return place; };
    const auto result = calibrate(views_of_deviating_calibrator(same, trial), with_c_arm_prior());
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->found_tolerance_mm, 0) << trial;
    EXPECT_EQ(result->ball_rms_mm, 0) << trial;
    EXPECT_FALSE(warns(*result, Reason::calibrator_strained)) << trial;
    EXPECT_TRUE(result->notes.empty());
  }
}

TEST(Calibrate, StrainOfTheCalibratorIsWarnedOfWithItsAxis) {
  const auto longer = [](const Eigen::Vector3d& place) -> Eigen::Vector3d {
    return place.cwiseProduct(Eigen::Vector3d(1, 1, 1.01));
  };
  const auto result = calibrate(views_of_deviating_calibrator(longer, 0), with_c_arm_prior());
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(warns(*result, Reason::calibrator_strained));
  const auto warning = std::ranges::find(result->warnings, Reason::calibrator_strained, &Warning::reason);
  EXPECT_GT(std::abs(warning->figures.at("z")), 0.9);
  EXPECT_NEAR(warning->figures.at("per_cent"), 0.67, 0.25);  // the change of volume is not observable
}

TEST(Calibrate, DeclaredToleranceIsNotedWithTheBallsOffsets) {
  RandomStream random(23, 0);
  const auto off = [&](const Eigen::Vector3d& place) -> Eigen::Vector3d {
    return place + 0.3 * normal_3(random);
  };
  CalibrationOptions options = with_c_arm_prior();
  options.common.ball_covariance_mm2.assign(12, 0.09 * Eigen::Matrix3d::Identity());
  const auto result = calibrate(views_of_deviating_calibrator(off, 3), options);
  ASSERT_TRUE(result.has_value());
  for (const auto& of_view : result->fiducials)
    for (const fiducials::Fiducial& ball : of_view)
      EXPECT_EQ(ball.status, fiducials::FiducialStatus::used) << ball.label;
  ASSERT_EQ(result->notes.size(), 1u);
  EXPECT_EQ(result->notes[0].reason, Reason::calibrator_deviates);
  EXPECT_NEAR(result->ball_rms_mm, 0.3 * std::sqrt(3), 0.2);
}

TEST(Calibrate, SixFiducialsAreRequired) {
  RandomStream random(15, 0);
  auto view = observed_fiducials("AP", paper_view(0.3), 0.1, random, 7);
  view.fiducials[2].status = fiducials::FiducialStatus::occluded;
  const auto six = calibrate({view}, {});
  ASSERT_TRUE(six.has_value()) << six.error().message;
  EXPECT_EQ(six->warnings.at(0).reason, Reason::few_fiducials);
  view.fiducials[4].status = fiducials::FiducialStatus::outside;
  const auto five = calibrate({view}, {});
  ASSERT_FALSE(five.has_value());
  EXPECT_EQ(five.error().reason, Reason::too_few_fiducials);
  EXPECT_EQ(five.error().view, "AP");
  EXPECT_EQ(five.error().figures.at("n"), 5);
}

TEST(Calibrate, CoplanarBallsWrongLabelsAndZeroSigmaAreRefused) {
  auto flat = pair_of_views(0.1, 2);
  for (auto& f : flat[0].fiducials) f.centre_in_calibrator.z() = 0;
  EXPECT_EQ(calibrate(flat, {}).error().reason, Reason::coplanar_fiducials);
  auto shifted = pair_of_views(0.1, 2);
  for (std::size_t k = 0; k + 1 < 12; ++k)
    std::swap(shifted[1].fiducials[k].uv, shifted[1].fiducials[k + 1].uv);
  const auto refused = calibrate(shifted, {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().reason, Reason::residual_too_large) << refused.error().message;
  EXPECT_EQ(refused.error().view, "LAT");
  auto without_sigma = pair_of_views(0.1, 2);
  without_sigma[0].fiducials[0].sigma_px = 0;
  EXPECT_EQ(calibrate(without_sigma, {}).error().reason, Reason::bad_value);
}

TEST(Calibrate, FiducialsInAPlaneAfterRejectionAreAMismatch) {
  auto views = pair_of_views(0.1, 4);
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t k = 0; k < 7; ++k) {  // seven in a plane; the others of the second view are displaced
      fiducials::Fiducial& ball = views[i].fiducials[k];
      ball.centre_in_calibrator.z() = 30;
      ball.uv = paper_view(i == 0 ? 0 : std::numbers::pi / 2).project(ball.centre_in_calibrator);
    }
  for (std::size_t k = 7; k < 12; ++k)
    views[1].fiducials[k].uv += Eigen::Vector2d(12, 9) * (k % 2 == 0 ? 1 : -1);
  const auto refused = calibrate(views, {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().reason, Reason::calibrator_mismatch) << refused.error().message;
  EXPECT_EQ(refused.error().view, "LAT");
  EXPECT_GE(refused.error().figures.at("rejected"), 4);
}

TEST(CalibratePaper, IsTheDltOfEachView) {
  const auto views = pair_of_views(0.5, 3);
  const auto result = calibrate_paper(views, {});
  ASSERT_TRUE(result.has_value());
  // Eq. 7 by its normal equations, in scaled units for their condition.
  const auto& balls = views[1].fiducials;
  Eigen::MatrixXd design(2 * balls.size(), 11);
  Eigen::VectorXd pixels(design.rows());
  constexpr double unit_mm = 50, unit_px = 500, middle_px = 512;
  for (std::size_t k = 0; k < balls.size(); ++k) {
    const Eigen::Vector3d p = balls[k].centre_in_calibrator / unit_mm;
    const Eigen::Vector2d uv = (balls[k].uv.array() - middle_px) / unit_px;
    const auto row = 2 * Eigen::Index(k);
    design.row(row) << p.transpose(), 1, Eigen::RowVector4d::Zero(), -uv.x() * p.transpose();
    design.row(row + 1) << Eigen::RowVector4d::Zero(), p.transpose(), 1, -uv.y() * p.transpose();
    pixels.segment<2>(row) = uv;
  }
  const Eigen::VectorXd a = (design.transpose() * design).ldlt().solve(design.transpose() * pixels);
  for (const fiducials::Fiducial& ball : balls) {
    const Eigen::Vector4d p = (ball.centre_in_calibrator / unit_mm).homogeneous();
    const double w = 1 + a.tail<3>().dot(p.head<3>());
    const Eigen::Vector2d uv(a.head<4>().dot(p) / w, a.segment<4>(4).dot(p) / w);
    const Eigen::Vector2d found = result->views[1].view.project(ball.centre_in_calibrator);
    EXPECT_LT((found - (uv.array() * unit_px + middle_px).matrix()).norm(), 1e-5);
  }
  EXPECT_EQ(result->views[1].dof, 13);
  EXPECT_EQ(result->joint_covariance.size(), 0);
}

TEST(CheckViewsApart, AngleIsThatOfLines) {
  const auto views_at = [](double degrees) {
    return std::vector<CalibratedView>{{"AP", paper_view(0), {}},
                                       {"LAT", paper_view(degrees * std::numbers::pi / 180), {}}};
  };
  EXPECT_TRUE(check_views_apart(views_at(90), {0, 0, 40}).has_value());
  EXPECT_TRUE(check_views_apart(views_at(31), {0, 0, 40}).has_value());
  for (double degrees : {0.0, 29.0, 170.0}) {
    const auto refused = check_views_apart(views_at(degrees), {0, 0, 40});
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().reason, Reason::views_too_close);
  }
}

}  // namespace
}  // namespace helicarm::calibration
