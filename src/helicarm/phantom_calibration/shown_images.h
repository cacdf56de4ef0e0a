// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/phantom_calibration/measure_phantom.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::phantom_calibration {

/// Gives each view of the result its rectified image for the report. `view_of_case`: of each, its index among
/// `detected`.
void add_images(const std::vector<pipeline::RectifiedView>& detected,
                const std::vector<std::size_t>& view_of_case, unsigned threads, PhantomResult& result);

}  // namespace helicarm::phantom_calibration
