// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/detection/dot.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::detection {

/// What to look for in an image without knowledge of plate or calibrator.
enum class MarkKind {
  balls,   ///< metal: dark, or bright where the grey values are inverted
  holes,   ///< bright dots
  crosses  ///< two wires that cross
};
inline constexpr std::array<std::string_view, 3> mark_words{"balls", "holes", "crosses"};

/// The kind of this name; `usage` for any other word.
Expected<MarkKind> mark_kind(std::string_view word);

/// All marks of a kind (raw pixels). Metal is dark in most images and bright in the others: the polarity that
/// shows more marks is taken.
std::vector<Dot> find_marks(const xray::XrayImage& xray_image, MarkKind kind);

}  // namespace helicarm::detection
