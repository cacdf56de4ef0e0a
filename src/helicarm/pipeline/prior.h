// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// What the file and the plate say of a view's intrinsics. The file's source distance is nominal, and the
/// central ray meets the receiver somewhere about its middle; square pixels are as good as the rectification.
IntrinsicsPrior intrinsics_prior(const XrayImage& xray_image, const DistortionMap& map);

/// How far a C-arm that nobody knows may be from its file's word, and its views from each other (sag).
CArmPrior unknown_c_arm();

}  // namespace helicarm
