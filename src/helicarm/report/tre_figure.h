// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/localization/tre_volume.h"

namespace helicarm::report {

/// Predicted TRE as a separate SVG document: slices along XOY and XOZ through the centre of the volume (the
/// paper's Fig. 7), with isolines at the ticks of the scale.
std::string tre_figure(const localization::TreVolume& volume);

}  // namespace helicarm::report
