// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/json.h"

namespace helicarm::pipeline {

/// As in result.json's "parameters": names, covariance, standard deviations; null without a covariance.
Json parameters_json(const calibration::CalibratedView& view);

}  // namespace helicarm::pipeline
