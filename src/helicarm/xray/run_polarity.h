// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// The image with the polarity of its run: stored values inverted, or not, whatever this frame alone looks
/// like. The reader's warning is removed; the run has one of its own.
void take_polarity(XrayImage& xray_image, bool run_is_inverted);

}  // namespace helicarm::xray
