// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "gui/scene/tre_slice.h"

/// The scene's colours on a dark background; views in the colour-blind safe palette of Okabe and Ito.
namespace helicarm::gui::palette {

inline constexpr Colour background{20, 24, 29}, text{225, 230, 236}, steel{190, 198, 208},
    plastic{150, 170, 190}, bone{226, 214, 190}, refused{150, 150, 150}, point{255, 92, 92}, ray{120, 96, 96},
    tunnel{86, 180, 233}, tool{245, 245, 245}, tool_grip{130, 140, 152}, robot{112, 128, 146},
    joint{76, 132, 190}, path{240, 228, 66}, breach{255, 70, 60}, thin{255, 190, 60};
inline constexpr std::array<Colour, 3> axes{{{230, 90, 80}, {90, 200, 110}, {95, 150, 255}}};
inline constexpr std::array<Colour, 4> views{{{230, 159, 0}, {0, 178, 135}, {204, 121, 167}, {213, 94, 0}}};

inline Colour of_view(std::size_t number) { return views[number % views.size()]; }

/// Blended halfway with the background.
inline Colour dim(const Colour& colour) {
  Colour dimmed{};
  for (std::size_t c = 0; c < 3; ++c) dimmed[c] = std::uint8_t((colour[c] + background[c]) / 2);
  return dimmed;
}

}  // namespace helicarm::gui::palette
