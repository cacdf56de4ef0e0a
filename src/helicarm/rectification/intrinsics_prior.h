// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/intrinsics_prior.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

/// The intrinsics prior of a view from its file and rectification: nominal source distance, principal point
/// at the image's centre, pixel aspect. The labelling and the calibration start from it.
geometry::IntrinsicsPrior intrinsics_prior(const xray::XrayImage& xray_image, const DistortionMap& map);

}  // namespace helicarm::rectification
