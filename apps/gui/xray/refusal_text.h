// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <optional>

#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// Why a result was refused: the reason with its code, then the likely causes in order, the next step and the
/// figures.
struct RefusalText {
  QString reason, details;
};

/// Shown in the view concerned, in the first one where none is; empty for other views and without a refusal.
std::optional<RefusalText> refusal_of(const pipeline::Result& result, std::size_t view);

}  // namespace helicarm::gui
