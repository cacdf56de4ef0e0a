// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/locate.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::localization {
namespace {

geometry::View paper_view(double alpha) {
  const Eigen::Matrix3d rotation = geometry::rotation_from_euler(alpha, 0, 0);
  return {{6000, 6000, 512, 512, 0},
          {rotation, Eigen::Vector3d(0, 0, 800) - rotation * Eigen::Vector3d(0, 0, 40)}};
}

const std::vector<geometry::View> truth{paper_view(0), paper_view(std::numbers::pi / 2)};
const Eigen::Vector3d target(12, -20, 55);

/// Twelve balls in each view, as in 2.3.3, with the nominal intrinsics as prior.
std::vector<calibration::ViewFiducials> noisy_fiducials(double sigma, RandomStream& random) {
  std::vector<calibration::ViewFiducials> views;
  for (const geometry::View& view : truth) {
    calibration::ViewFiducials seen{fmt::format("V{}", views.size()), {}};
    seen.prior = {std::nullopt, Eigen::Vector2d(512, 512), 1, geometry::NormalPrior{1, 0.001}};
    for (int k = 0; k < 12; ++k) {
      const double t = std::numbers::pi / 6 + k * std::numbers::pi / 2, radius = 60 * std::exp(-t / 31.529);
      fiducials::Fiducial f{fmt::format("P{}", k), {radius * std::cos(t), radius * std::sin(t), 3.979 * t}};
      f.status = fiducials::FiducialStatus::used;
      f.sigma_px = sigma;
      f.uv = view.project(f.centre_in_calibrator) + sigma * normal_2(random);
      seen.fiducials.push_back(f);
    }
    views.push_back(seen);
  }
  return views;
}

Expected<calibration::CalibrationResult> noisy_calibration(double sigma, RandomStream& random) {
  calibration::CalibrationOptions options;
  options.rejection_probability = 0;
  options.common.c_arm.principal = calibration::IntrinsicsVariation{1000, 0.7};
  return calibration::calibrate(noisy_fiducials(sigma, random), options);
}

std::vector<PointObservation> images_of(const Eigen::Vector3d& point, double sigma, RandomStream& random) {
  std::vector<PointObservation> observations;
  for (std::size_t i = 0; i < truth.size(); ++i)
    observations.push_back(
        {i, truth[i].project(point) + sigma * normal_2(random), sigma * sigma * Eigen::Matrix2d::Identity()});
  return observations;
}

TEST(Locate, EllipsoidsCoverAtTheirNominalRate) {
  for (const auto& [ball_sigma, pixel_sigma] : {std::pair{0.5, 0.5}, {0.5, 0.0}}) {
    const int trials = 2000;
    int covered = 0;
    double error2 = 0, predicted2 = 0;
    for (int trial = 0; trial < trials; ++trial) {
      RandomStream random(21, 0, std::uint64_t(trial));
      const auto calibration = noisy_calibration(ball_sigma, random);
      ASSERT_TRUE(calibration.has_value());
      const auto point =
          locate("T", PointSource::target, images_of(target, pixel_sigma, random), *calibration);
      ASSERT_TRUE(point.has_value());
      const Eigen::Vector3d error = point->point_in_anchor - target;
      covered += error.dot(point->covariance_in_anchor.ldlt().solve(error)) < 7.8147;  // chi2, 3 dof, 95 %
      error2 += error.squaredNorm() / trials;
      predicted2 += point->covariance_in_anchor.trace() / trials;
    }
    EXPECT_GT(double(covered) / trials, 0.94);
    EXPECT_LT(double(covered) / trials, 0.965);
    EXPECT_NEAR(std::sqrt(error2 / predicted2), 1, 0.05);
  }
}

calibration::Calibration exact_calibration() { return {{{"AP", truth[0], {}}, {"LAT", truth[1], {}}}, {}}; }

TEST(Locate, ExactPicksInAnExactCalibration) {
  RandomStream random(22, 0);
  const auto point = locate("T", PointSource::pick, images_of(target, 0, random), exact_calibration());
  ASSERT_TRUE(point.has_value());
  EXPECT_LT((point->point_in_anchor - target).norm(), 1e-9);
  EXPECT_EQ(point->views, (std::vector<std::string>{"AP", "LAT"}));
}

TEST(Locate, PointThatMovesWithABoneIsFoundInTheBone) {
  const Eigen::Vector3d in_bone(3, 4, 5);
  std::vector<PointObservation> observations;
  for (std::size_t i = 0; i < 2; ++i) {
    const geometry::RigidTransform pose{geometry::rotation_from_euler(0.1 + 0.2 * double(i), 0.3, 0),
                                        {5, 10.0 * double(i), 40}};
    observations.push_back({i, truth[i].project(pose * in_bone), Eigen::Matrix2d::Identity(), pose});
  }
  const auto point = locate("T", PointSource::pick, observations, exact_calibration());
  ASSERT_TRUE(point.has_value());
  EXPECT_LT((point->point_in_anchor - in_bone).norm(), 1e-9);
}

/// The lateral image moved by `off` px.
std::vector<PointObservation> wrong_images(const Eigen::Vector2d& off, double sigma) {
  RandomStream random(26, 0);
  auto observations = images_of(target, 0, random);
  for (PointObservation& observation : observations)
    observation.covariance_px2 = sigma * sigma * Eigen::Matrix2d::Identity();
  observations[1].uv += off;
  return observations;
}

TEST(Locate, LengthAt95IsNeverBelowHalfTheRayGap) {
  RandomStream random(25, 0);
  const auto calibrated = noisy_calibration(0.05, random);
  ASSERT_TRUE(calibrated.has_value());
  calibration::Calibration paper = exact_calibration();
  for (calibration::CalibratedView& view : paper.views) view.reprojection_rms_px = 0.5;
  for (const calibration::Calibration& calibration :
       {static_cast<const calibration::Calibration&>(*calibrated), exact_calibration(), paper})
    for (const double sigma : {0.0, 0.5, 5.0})
      for (const double off : {0.0, 0.3, 5.0, 150.0}) {
        const auto point = locate("T", PointSource::pick, wrong_images({off, off}, sigma), calibration);
        ASSERT_TRUE(point.has_value());
        EXPECT_GE(length_at_95(point->covariance_in_anchor), 0.5 * point->ray_gap_mm * (1 - 1e-9))
            << sigma << " " << off;
      }
}

/// Views over 150 degrees, taken as exact, and a point observed in them with the noise.
struct ManyViews {
  calibration::Calibration calibration;
  std::vector<PointObservation> observations;
};

ManyViews many_views(std::size_t count, double sigma, double actual_sigma, RandomStream& random) {
  ManyViews views;
  for (std::size_t i = 0; i < count; ++i) {
    const geometry::View view = paper_view(2.6 * double(i) / double(count - 1));
    views.calibration.views.push_back({fmt::format("V{}", i), view, {}});
    views.observations.push_back({i, view.project(target) + actual_sigma * normal_2(random),
                                  sigma * sigma * Eigen::Matrix2d::Identity()});
  }
  return views;
}

TEST(Locate, LengthAt95FallsWithTheNumberOfViewsAndCovers) {
  for (const std::size_t count : {3U, 10U, 50U}) {
    const int trials = 400;
    int covered = 0, missing = 0;
    double length = 0;
    for (int trial = 0; trial < trials; ++trial) {
      RandomStream random(29, count, std::uint64_t(trial));
      const ManyViews views = many_views(count, 0.5, 0.5, random);
      const auto point = locate("T", PointSource::pick, views.observations, views.calibration);
      ASSERT_TRUE(point);
      const double at_95 = length_at_95(point->covariance_in_anchor);
      covered += (point->point_in_anchor - target).norm() < at_95;
      missing += point->missing_rays.has_value();
      length += at_95 / trials;
    }
    EXPECT_NEAR(double(covered) / trials, 0.95, 0.035) << count;
    EXPECT_LT(missing, 6) << count;
    EXPECT_NEAR(length * std::sqrt(double(count)), 0.27, 0.05) << count;
  }
}

TEST(Locate, FarMoreNoiseThanStatedInManyViewsIsInTheCovariance) {
  const int trials = 200;
  int covered = 0;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(30, 0, std::uint64_t(trial));
    const ManyViews views = many_views(50, 0.5, 1.0, random);  // chi2 is 4 per degree of freedom
    const auto point = locate("T", PointSource::pick, views.observations, views.calibration);
    ASSERT_TRUE(point && point->missing_rays);
    covered += (point->point_in_anchor - target).norm() < length_at_95(point->covariance_in_anchor);
  }
  EXPECT_GT(covered, 0.9 * trials);
}

TEST(Locate, RaysThatMissAreWarnedOfWithAndWithoutCovariance) {
  RandomStream random(25, 0);
  const auto calibrated = noisy_calibration(0.05, random);
  ASSERT_TRUE(calibrated.has_value());
  for (const calibration::Calibration& calibration :
       {static_cast<const calibration::Calibration&>(*calibrated), exact_calibration()}) {
    const auto wrong = locate("T", PointSource::pick, wrong_images({60, 60}, 0.5), calibration);
    ASSERT_TRUE(wrong && wrong->missing_rays);
    EXPECT_EQ(wrong->missing_rays->reason, Reason::residual_too_large);
    EXPECT_GT(wrong->missing_rays->figures.at("ray_gap_mm"), 3);
    const auto right = locate("T", PointSource::pick, wrong_images({0.3, 0.3}, 0.5), calibration);
    EXPECT_FALSE(right->missing_rays);
  }
}

TEST(Locate, ResidualsOfAPaperCalibrationChangeOnlyTheCovariance) {
  calibration::Calibration paper = exact_calibration();
  const auto before = locate("T", PointSource::pick, wrong_images({0.4, 0.2}, 0.1), paper);
  paper.views[0].reprojection_rms_px = 0.7;
  paper.views[1].reprojection_rms_px = 0.2;
  const auto after = locate("T", PointSource::pick, wrong_images({0.4, 0.2}, 0.1), paper);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(before->point_in_anchor, after->point_in_anchor);
  EXPECT_GT(after->predicted_rms_mm(), 2 * before->predicted_rms_mm());
}

TEST(Locate, PointOfAPaperCalibrationIsThatOfEq8) {
  RandomStream random(5, 3);
  const auto calibration = calibration::calibrate_paper(noisy_fiducials(1, random), {});
  ASSERT_TRUE(calibration);
  const auto observations = images_of(target, 1, random);
  Eigen::Matrix<double, 4, 3> left;
  Eigen::Vector4d right;
  for (int i = 0; i < 2; ++i) {
    const geometry::DltFactors& a = *calibration->views[std::size_t(i)].dlt;  // a(k - 1) is A_k
    const double u = observations[std::size_t(i)].uv.x(), v = observations[std::size_t(i)].uv.y();
    left.row(2 * i) << a(4) * u - a(0), a(5) * u - a(1), a(6) * u - a(2);
    left.row(2 * i + 1) << a(4) * v - a(7), a(5) * v - a(8), a(6) * v - a(9);
    right.segment<2>(2 * i) << a(3) - u, a(10) - v;
  }
  const Eigen::Vector3d printed = (left.transpose() * left).ldlt().solve(left.transpose() * right);
  const auto point = locate("T", PointSource::pick, observations, *calibration);
  ASSERT_TRUE(point);
  EXPECT_LT((point->point_in_anchor - printed).norm(), 1e-6);
}

TEST(Locate, RayGapsOfPaperCalibrationsAreWhatTheirErrorsExplain) {
  constexpr int trials = 400;
  double chi2 = 0;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(28, 0, std::uint64_t(trial));
    const auto paper = calibration::calibrate_paper(noisy_fiducials(0.5, random), {});
    ASSERT_TRUE(paper.has_value());
    auto observations = images_of(target, 0.5, random);
    for (PointObservation& observation : observations) observation.covariance_px2.setZero();
    const auto point = locate("T", PointSource::pick, observations, *paper);
    ASSERT_TRUE(point.has_value());
    chi2 += point->chi2 / trials;
  }
  EXPECT_NEAR(chi2, 1, 0.2);  // 1.26 without the effect of the parameters
}

TEST(Locate, MotionAlongTheFirstRayLeavesNoGapAndIsInTheCovariance) {
  const calibration::Calibration calibration = exact_calibration();
  const Warning note = unobservable_motion("T", target, calibration.views[0], 0);
  const Eigen::Vector3d along(note.figures.at("direction_x"), note.figures.at("direction_y"),
                              note.figures.at("direction_z"));
  EXPECT_NEAR(along.norm(), 1, 1e-12);
  RandomStream random(27, 0);
  auto observations = images_of(target, 0, random);
  observations[0].covariance_px2 = observations[1].covariance_px2 = 0.25 * Eigen::Matrix2d::Identity();
  observations[1].uv = truth[1].project(target + 3 * along);
  const auto still = locate("T", PointSource::pick, observations, calibration);
  const auto moving = locate("T", PointSource::pick, observations, calibration, 2);
  ASSERT_TRUE(still && moving);
  EXPECT_NEAR((still->point_in_anchor - target).norm(), 3, 0.01);
  EXPECT_LT(still->ray_gap_mm, 1e-6);
  EXPECT_LT(length_at_95(still->covariance_in_anchor), 1);
  EXPECT_NEAR(std::sqrt(along.dot(moving->covariance_in_anchor * along)), 2, 0.1);
  EXPECT_GT(length_at_95(moving->covariance_in_anchor), 3);
}

TEST(Locate, OneViewIsNotEnough) {
  RandomStream random(23, 0);
  auto observations = images_of(target, 1, random);
  observations.pop_back();
  EXPECT_EQ(locate("T", PointSource::pick, observations, exact_calibration()).error().reason,
            Reason::not_seen);
}

TEST(PredictCovariance, GrowsWithTheDistanceFromTheBalls) {
  RandomStream random(24, 0);
  const auto calibration = noisy_calibration(0.5, random);
  ASSERT_TRUE(calibration.has_value());
  const auto near = predict_covariance({0, 0, 40}, 0.5, *calibration);
  const auto far = predict_covariance({90, 0, 40}, 0.5, *calibration);
  ASSERT_TRUE(near && far);
  EXPECT_GT(far->trace(), near->trace());
  EXPECT_FALSE(predict_covariance({0, 0, -2000}, 0.5, *calibration).has_value());
}

}  // namespace
}  // namespace helicarm::localization
