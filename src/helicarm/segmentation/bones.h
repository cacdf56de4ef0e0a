// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/segmentation/segment.h"

namespace helicarm::segmentation {

/// Refuses (bad_value) a name that cannot be a file's.
Expected<void> check_name(const std::string& name);

/// Sets the figures of the bones from the labels, and the notes.
void measure_bones(Segmentation& made);

}  // namespace helicarm::segmentation
