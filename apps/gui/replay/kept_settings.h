// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QSettings>

#include "gui/replay/settings_dialog.h"

namespace helicarm::gui {

/// Keeps the values of all fields that differ from their defaults, for the next start.
void keep_settings(QSettings& store, const Settings& settings);

/// The defaults with the kept values; those that are outside a field's limits by now are left out.
Settings kept_settings(const QSettings& store);

}  // namespace helicarm::gui
