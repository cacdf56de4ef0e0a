// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QByteArray>
#include <string>

namespace helicarm::gui {

/// The report's figures leave their looks to the page's style sheet: the same as a document of its own, with
/// its looks within, as QtSvg draws it. `on_page`: on white, not on an X-ray.
QByteArray print_svg(const std::string& figure, bool on_page = false);

}  // namespace helicarm::gui
