// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"

namespace helicarm::pipeline {

/// Prior of a C-arm without history: deviation from nominal, and sag between views.
calibration::CArmPrior unknown_c_arm();

}  // namespace helicarm::pipeline
