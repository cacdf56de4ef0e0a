// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/pipeline/result.h"

namespace helicarm::cli {

/// Writes report.html, NAME_overlay.png for each view unless `no_report`, and result.json: last, so that its
/// presence implies the other files. After a failure none of them remains.
Expected<void> write_result(const pipeline::Result& result, const std::filesystem::path& folder,
                            bool no_report);

}  // namespace helicarm::cli
