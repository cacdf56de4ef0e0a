// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

/// Fraction of the pixels inside the field (above black) that are clipped at the highest value.
double saturated_share(const xray::XrayImage& xray_image);

/// Refuses an image without structure (blank_image) or clipped nearly everywhere (saturated).
Expected<void> check_usable(const xray::XrayImage& xray_image);

}  // namespace helicarm::rectification
