// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// The report on A4 pages: figures of merit, views, points, tunnels, verification, rectification; or the
/// refusal and what was known until then. No identity of the patient; written whole or not at all. Refuses
/// cannot_write. Needs an application (for its fonts).
Expected<void> write_pdf_report(const Result& result, const std::filesystem::path& path);

}  // namespace helicarm::gui
