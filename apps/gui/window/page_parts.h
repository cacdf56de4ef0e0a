// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "gui/window/page_table.h"
#include "gui/xray/text.h"

namespace helicarm::gui {

inline QString number(double value, int decimals) { return QString::number(value, 'f', decimals); }

}  // namespace helicarm::gui
