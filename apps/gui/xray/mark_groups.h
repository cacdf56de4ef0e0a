// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QFlags>

#include "helicarm/report/marks.h"

namespace helicarm::gui {

/// Groups of marks over an image that are shown or hidden together.
enum class MarkGroup { fiducials = 1, residuals = 2, plate = 4, outliers = 8, points = 16, labels = 32 };
Q_DECLARE_FLAGS(MarkGroups, MarkGroup)
Q_DECLARE_OPERATORS_FOR_FLAGS(MarkGroups)

inline constexpr MarkGroups all_marks{MarkGroup::fiducials | MarkGroup::residuals | MarkGroup::plate |
                                      MarkGroup::outliers | MarkGroup::points | MarkGroup::labels};

/// The marks of these groups. Candidates and guessed labels of a refused view are outliers.
report::ViewMarks only(MarkGroups groups, report::ViewMarks marks);

}  // namespace helicarm::gui
