// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/priors.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

/// What the file's tags and the making of C-arms say of a view's intrinsics, in rectified pixels: the source
/// distance within 1 %, square pixels, the central ray within a centimetre or so of the picture's centre.
IntrinsicsPrior intrinsics_prior(const Exposure& exposure, const DistortionMap& map);

/// How far one stand sags between two views: a few mm in source distance, about a centimetre across.
SpreadPrior spread_prior(const Exposure& exposure, const DistortionMap& map);

}  // namespace helicarm
