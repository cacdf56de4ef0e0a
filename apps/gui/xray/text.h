// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <string_view>

namespace helicarm::gui {

inline QString text(std::string_view words) {
  return QString::fromUtf8(words.data(), static_cast<qsizetype>(words.size()));
}

inline QString fixed(double value, int digits) { return QString::number(value, 'f', digits); }

}  // namespace helicarm::gui
