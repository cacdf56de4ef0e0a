// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm::fuzz {

/// Reads a volume file and checks what was accepted.
void run_volume(std::string_view bytes);
void check_volume(const Expected<volume::Volume>& volume);

/// `count` voxels 0, 1, ... of 16 bits, little endian.
std::string voxels16(int count);
std::string gzipped(const std::string& bytes);

}  // namespace helicarm::fuzz
