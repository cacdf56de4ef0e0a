// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/localization/tre_volume.h"

namespace helicarm {

/// The predicted TRE as an SVG image: the slices through the volume's middle along XOY and XOZ (the paper's
/// Fig. 7), with isolines at the ticks of the scale. A document of its own.
std::string tre_figure(const TreVolume& volume);

}  // namespace helicarm
