// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/localization/locate.h"
#include "helicarm/phantom_calibration/scale.h"
#include "helicarm/phantom_calibration/synthetic_phantom_test.h"
#include "helicarm/pipeline/prior.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

const Vector3d far_target{12, 15, 82};

/// Covariance of all balls as six views and one distance measure them.
ScaledPoints measured_balls(double distance_sigma_mm) {
  const auto truth = helix_centres();
  BundleProblem problem = synthetic_problem(truth, 6, 0.05, 1);
  const auto fit = adjust(problem);
  const std::vector<std::string> labels(truth.size());
  return *scaled_by(truth, fit->covariance_mm2, {{0, 2, (truth[0] - truth[2]).norm(), distance_sigma_mm}},
                    labels);
}

/// A file that states these errors, and has drawn ones.
phantom::Calibrator drawn_file(const ScaledPoints& balls, RandomStream& random) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(balls.covariance_mm2);
  Eigen::VectorXd errors(balls.covariance_mm2.rows());
  for (double& error : errors) error = random.normal();
  errors = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().cwiseProduct(errors);
  phantom::Calibrator file = phantom::udcsc();
  file.scale_sigma = balls.scale_sigma;
  file.joint_covariance = {{}, balls.covariance_mm2};
  for (std::size_t i = 0; i < file.balls.size(); ++i) {
    const auto at = 3 * Eigen::Index(i);
    file.balls[i].centre_in_calibrator += errors.segment<3>(at);
    file.balls[i].covariance_mm2 = balls.covariance_mm2.block<3, 3>(at, at);
    file.joint_covariance->labels.push_back(file.balls[i].label);
  }
  return file;
}

/// The target, located by two views that are calibrated with a file.
localization::LocatedPoint located_with(const phantom::Calibrator& file, RandomStream& random) {
  constexpr double image_noise_px = 0.02;
  const auto noisy = [&](const Eigen::Vector2d& uv) {
    return Eigen::Vector2d(uv + image_noise_px * Eigen::Vector2d(random.normal(), random.normal()));
  };
  const auto truth = helix_centres();
  std::vector<calibration::ViewFiducials> views;
  std::vector<localization::PointObservation> observations;
  for (const int number : {0, 5}) {
    calibration::ViewFiducials view{std::to_string(number), {}};
    view.start = synthetic_view(number, random);
    view.prior = synthetic_problem(truth, 1, 0, 0).views[0].prior;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      fiducials::Fiducial f{file.balls[i].label, file.balls[i].centre_in_calibrator};
      f.status = fiducials::FiducialStatus::used;
      f.sigma_px = image_noise_px;
      f.uv = noisy(view.start->project(truth[i]));
      view.fiducials.push_back(f);
    }
    observations.push_back({views.size(), noisy(view.start->project(far_target)),
                            image_noise_px * image_noise_px * Eigen::Matrix2d::Identity()});
    views.push_back(std::move(view));
  }
  calibration::CalibrationOptions options;
  options.common = pipeline::common_prior(file);
  options.rejection_probability = 0;
  const auto result = calibration::calibrate(views, options);
  EXPECT_TRUE(result) << result.error().message;
  return *localization::locate("T", localization::PointSource::target, observations, *result);
}

/// Squared errors over what the covariance predicts, mean over simulated files: of all three coordinates, and
/// along the growth of the phantom.
struct Calibrated {
  double all = 0, growth = 0, rms_mm = 0;
};

Calibrated over_predicted(const ScaledPoints& balls, bool correlated) {
  constexpr int trials = 300;
  const Vector3d outwards = (far_target - phantom::middle_of(phantom::udcsc())).normalized();
  Calibrated mean;
  double squared = 0;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(21, 0, std::uint64_t(trial));
    phantom::Calibrator file = drawn_file(balls, random);
    if (!correlated) file.joint_covariance.reset();
    const auto point = located_with(file, random);
    const Vector3d error = point.point_in_anchor - far_target;
    const Eigen::Matrix3d& covariance = point.covariance_in_anchor;
    mean.all += error.dot(covariance.ldlt().solve(error)) / 3 / trials;
    mean.growth += std::pow(error.dot(outwards), 2) / outwards.dot(covariance * outwards) / trials;
    squared += error.squaredNorm() / trials;
  }
  mean.rms_mm = std::sqrt(squared);
  return mean;
}

TEST(MeasuredFile, LocatedPointsScatterAsTheCorrelatedErrorsOfTheBallsPredict) {
  const auto mean = over_predicted(measured_balls(0.02), true);
  EXPECT_NEAR(mean.all, 1, 0.12);  // standard error 0.05
}

TEST(MeasuredFile, CorrelationsOfTheBallsReduceTheErrorOfALocatedPoint) {
  const ScaledPoints balls = measured_balls(0.001);
  EXPECT_LT(over_predicted(balls, true).rms_mm, 0.9 * over_predicted(balls, false).rms_mm);
}

class ErrorOfTheScale : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(MeasuredFile, ErrorOfTheScale, testing::Bool());

TEST_P(ErrorOfTheScale, EntersTheLocatedPointOnce) {
  const auto mean = over_predicted(measured_balls(0.5), GetParam());
  EXPECT_NEAR(mean.growth, 1, 0.25);  // standard error 0.08; 0.5 if it entered twice
}

}  // namespace
}  // namespace helicarm::phantom_calibration
