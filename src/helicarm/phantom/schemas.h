// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/json.h"

namespace helicarm::phantom {

/// The JSON Schemas of calibrator.json and plate.json (docs/formats.md).
Json calibrator_schema();
Json plate_schema();

}  // namespace helicarm::phantom
