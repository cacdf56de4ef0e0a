// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QByteArray>
#include <string>

namespace helicarm::gui {

/// The report's figures take their style from the page's style sheet; this returns a separate document with
/// inline style for QtSvg. `on_page`: on white, not on an X-ray image.
QByteArray print_svg(const std::string& figure, bool on_page = false);

/// A document of `report::chart_svg` with the rules of its style sheet in its elements, and without clip
/// paths: QtSvg does not apply all of the former, and draws the latter.
QByteArray chart_document(const std::string& chart);

}  // namespace helicarm::gui
