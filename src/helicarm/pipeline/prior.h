// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// The intrinsics prior of a view from its file and rectification: nominal source distance, principal point
/// at the image's centre, pixel aspect.
IntrinsicsPrior intrinsics_prior(const XrayImage& xray_image, const DistortionMap& map);

/// Prior of a C-arm without history: deviation from nominal, and sag between views.
CArmPrior unknown_c_arm();

}  // namespace helicarm
