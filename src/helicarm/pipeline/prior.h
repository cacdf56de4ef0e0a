// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

/// What the file and the plate say of a view's intrinsics. The file's source distance is nominal, and the
/// central ray meets the receiver somewhere about its middle; square pixels are as good as the rectification.
IntrinsicsPrior intrinsics_prior(const Exposure& exposure, const DistortionMap& map);

/// How far a C-arm that nobody knows may be from its file's word, and its views from each other (sag).
MachinePrior unknown_machine();

}  // namespace helicarm
