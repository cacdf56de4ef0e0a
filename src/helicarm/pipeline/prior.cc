// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/prior.h"

#include <string>

#include <fmt/format.h>

#include "helicarm/xray/digest.h"

namespace helicarm::pipeline {
namespace {

// About 1 % of a source distance of 1000 mm; a principal point within 12 mm of the centre; sag between two
// views of up to 2 mm (source distance) and 6 mm (principal point).
constexpr calibration::IntrinsicsVariation focal_mm{10, 1.4};
constexpr calibration::IntrinsicsVariation principal_mm{7, 4.2};

std::string digest_of_balls(const phantom::Calibrator& calibrator, const calibration::CommonPrior& common) {
  std::string numbers;
  const auto add = [&](const auto& values) {
    for (const double value : values.reshaped()) numbers += fmt::format("{:.17g} ", value);
  };
  for (const phantom::CalibratorBall& ball : calibrator.balls) add(ball.centre_in_calibrator);
  for (const Eigen::Matrix3d& covariance : common.ball_covariance_mm2) add(covariance);
  add(common.joint_ball_covariance_mm2);
  return xray::digest(numbers);
}

}  // namespace

calibration::CArmPrior unknown_c_arm() { return {focal_mm, principal_mm}; }

calibration::CommonPrior common_prior(const phantom::Calibrator& calibrator) {
  calibration::CommonPrior common{unknown_c_arm(), phantom::ball_covariances(calibrator),
                                  phantom::joint_ball_covariance(calibrator), calibrator.scale_sigma};
  if (!common.ball_covariance_mm2.empty() || common.joint_ball_covariance_mm2.size() > 0)
    common.calibrator = digest_of_balls(calibrator, common);
  return common;
}

}  // namespace helicarm::pipeline
