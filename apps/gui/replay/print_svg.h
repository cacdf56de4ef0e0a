// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QByteArray>
#include <string>

namespace helicarm::gui {

/// The report's figures take their style from the page's style sheet; this returns a separate document with
/// inline style for QtSvg. `on_page`: on white, not on an X-ray image.
QByteArray print_svg(const std::string& figure, bool on_page = false);

}  // namespace helicarm::gui
