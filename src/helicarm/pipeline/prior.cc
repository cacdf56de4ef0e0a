// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/prior.h"

namespace helicarm::pipeline {
namespace {

// About 1 % of a source distance of 1000 mm; a principal point within 12 mm of the centre; sag between two
// views of up to 2 mm (source distance) and 6 mm (principal point).
constexpr calibration::IntrinsicsVariation focal_mm{10, 1.4};
constexpr calibration::IntrinsicsVariation principal_mm{7, 4.2};

}  // namespace

calibration::CArmPrior unknown_c_arm() { return {focal_mm, principal_mm}; }

calibration::CommonPrior common_prior(const phantom::Calibrator& calibrator) {
  return {unknown_c_arm(), phantom::ball_covariances(calibrator), phantom::joint_ball_covariance(calibrator),
          calibrator.scale_sigma};
}

}  // namespace helicarm::pipeline
