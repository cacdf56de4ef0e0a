// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QColor>
#include <QString>

/// Colours and text sizes, legible from 2 m. X-ray images and the scene keep their dark ground in both
/// themes.
namespace helicarm::gui::style {

enum class Theme { dark, light };

inline constexpr int smallest_text_px = 11, usual_text_px = 14, largest_text_px = 24;

struct Appearance {
  Theme theme = Theme::dark;
  int text_px = usual_text_px;
  bool operator==(const Appearance&) const = default;
};

struct Colours {
  QColor ground, panel, raised, pressed, chosen, line, disabled, text, quiet, blue, green, amber, red;
  QColor selected;  ///< of a table's row: figures in any of these colours are legible on it
};

const Colours& colours_of(Theme theme);

/// Of the whole application; its widgets are drawn again.
void apply(const Appearance& appearance);
Appearance applied();
/// Colours of the applied theme.
const Colours& colours();
/// A length in px at the usual text size, at the applied one.
int scaled(int px);

QString sheet(const Appearance& appearance);

}  // namespace helicarm::gui::style
