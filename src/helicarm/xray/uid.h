// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/random.h"

namespace helicarm::xray {

/// New DICOM UID, 2.25.<128-bit random UUID in decimal> (PS3.5 B.2), from the system's entropy; independent
/// of host names.
std::string make_uid();

/// Reproducible variant.
std::string make_uid(RandomStream& random);

}  // namespace helicarm::xray
