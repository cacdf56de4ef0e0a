// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "helicarm/pipeline/case.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::pipeline {

/// "helicarm" in $XDG_CACHE_HOME or ~/.cache; nothing where neither is known.
std::optional<std::filesystem::path> user_cache_folder();

/// The map of a view's separate plate image. With a cache: the one that this program fitted earlier to the
/// same file, plate, stated geometry and method, bit for bit; otherwise it is fitted, and kept there for its
/// owner only. The newest 256 maps stay, and other files; a folder that cannot be written keeps none. Fails
/// as `read_xray_image` and `rectify`.
Expected<rectification::DistortionMap> plate_image_map(const CaseView& view, const phantom::Plate& plate,
                                                       rectification::Method method,
                                                       const std::optional<std::filesystem::path>& cache);

}  // namespace helicarm::pipeline
