// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/random.h"

namespace helicarm {

/// A new DICOM UID, 2.25.<128-bit random UUID in decimal> (PS3.5 B.2), from the system's entropy; asks no
/// host name.
std::string make_uid();

/// The same, reproducibly.
std::string make_uid(RandomStream& random);

}  // namespace helicarm
