// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

/// Share of the pixels inside the field (above black) that are clipped at the highest value.
double saturated_share(const Exposure& exposure);

/// Refuses a picture that shows nothing (blank_image) or is clipped nearly everywhere (saturated).
Expected<void> check_usable(const Exposure& exposure);

}  // namespace helicarm
