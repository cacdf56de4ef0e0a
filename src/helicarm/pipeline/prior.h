// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::pipeline {

/// Prior of a C-arm without history: deviation from nominal, and sag between views.
calibration::CArmPrior unknown_c_arm();

/// That prior with the errors of a calibrator's file: the scale's as one number, and those of the balls
/// without it.
calibration::CommonPrior common_prior(const phantom::Calibrator& calibrator);

}  // namespace helicarm::pipeline
