// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace helicarm::report {

/// CSS of all charts.
inline constexpr const char* chart_style =
    ".grid{stroke:#e4e4e0} .frame{fill:none;stroke:#333} .band{fill:#b9b9b0;fill-opacity:0.45} "
    ".hatch{stroke:#8d8d85} .line{fill:none;stroke-width:1.8} .middle{text-anchor:middle} "
    ".end{text-anchor:end} .title{font-size:14px;font-weight:600} .note{fill:#555} "
    ".level{text-anchor:middle;paint-order:stroke;stroke:#fff;stroke-width:4px}";

}  // namespace helicarm::report
