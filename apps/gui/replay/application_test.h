// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QApplication>

namespace helicarm::gui {

/// The single QApplication that widgets, fonts and painters need.
inline QApplication& application() {
  static int count = 1;
  static char name[] = "test";
  static char* words[] = {name, nullptr};
  static auto* made = new QApplication(count, words);
  return *made;
}

}  // namespace helicarm::gui
