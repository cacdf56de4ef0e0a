// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// The report on A4 pages: key figures, views, points, tunnels, verification, rectification; or the refusal
/// with the results up to it. No patient identity; written completely or not at all. Refuses cannot_write.
/// Needs a QApplication (for its fonts).
Expected<void> write_pdf_report(const pipeline::Result& result, const std::filesystem::path& path);

}  // namespace helicarm::gui
