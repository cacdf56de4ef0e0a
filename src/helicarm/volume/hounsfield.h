// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Whether a volume that is taken as a CT may hold Hounsfield units: every CT of a body has values below 0
/// (air -1000, fat -100, noise of soft tissue), also inside it, spans hundreds, and ends below 32767. Warns
/// (not_hounsfield) of values that do not. Refuses (bad_value) a mask: 0 and one other whole number up to
/// 255. `origin` begins the messages.
Expected<std::vector<Warning>> check_hounsfield(const Volume& volume, const std::string& origin);

}  // namespace helicarm::volume
