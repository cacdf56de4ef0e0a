// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm::report {

/// The report as one HTML page: images embedded, no external resources, no patient identity.
std::string report_html(const pipeline::Result& result);

/// Writes report.html and NAME_overlay.png for each view into `folder`.
Expected<void> write_report(const pipeline::Result& result, const std::filesystem::path& folder);

/// Writes them if `with_report`, and result.json: last, so that its presence implies the other files. After a
/// failure none of them remains.
Expected<void> write_result(const pipeline::Result& result, const std::filesystem::path& folder,
                            bool with_report = true);

}  // namespace helicarm::report
