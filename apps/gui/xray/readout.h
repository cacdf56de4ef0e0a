// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>

#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// Of a raw pixel of a view: its coordinates, the grey value there (MONOCHROME1 inverted), and its place in
/// mm: in a calibrated view from the principal point, in the plane parallel to the detector through the
/// fiducials' centre; otherwise, if the pixel size is known, from the image centre on the detector or the
/// plate. Empty off the image.
QString readout_of(const pipeline::Result& result, std::size_t view, const Eigen::Vector2d& raw);

}  // namespace helicarm::gui
