// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/view.h"
#include "helicarm/image/image.h"
#include "helicarm/volume/absorber.h"

namespace helicarm::volume {

/// Line integrals of the attenuation from the source through each pixel's centre and the whole volume. World
/// of `view`: the patient frame. Refuses (bad_value) a source inside the volume. The result does not depend
/// on `threads` (0: all cores).
Expected<image::Image<float>> drr(const Absorber& absorber, const geometry::View& view, int width, int height,
                                  unsigned threads = 0);

}  // namespace helicarm::volume
