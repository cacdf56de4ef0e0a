// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::pipeline {

/// The intrinsics prior of a view from its file and rectification: nominal source distance, principal point
/// at the image's centre, pixel aspect.
calibration::IntrinsicsPrior intrinsics_prior(const xray::XrayImage& xray_image,
                                              const rectification::DistortionMap& map);

/// Prior of a C-arm without history: deviation from nominal, and sag between views.
calibration::CArmPrior unknown_c_arm();

}  // namespace helicarm::pipeline
