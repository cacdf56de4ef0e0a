// SPDX-License-Identifier: Apache-2.0
#include "touch_points.h"

#include <fmt/format.h>

#include "helicarm/core/text.h"

namespace helicarm::cli {

void touch_point(operation::Operation& operation, const std::string& name, LineInput& input,
                 const Ending& ending, Console& console) {
  console.progress << fmt::format("touch \"{}\" with the pointer, hold it still and press Enter\n",
                                  without_control_characters(name))
                   << std::flush;
  for (;;) {
    ending.wait_until([&] { return input.next(0).has_value(); });
    const auto off = operation.touch(name);
    if (off) {
      console.progress << fmt::format("{}: recorded, deviation {:.2f} mm\n", without_control_characters(name),
                                      *off)
                       << std::flush;
      return;
    }
    if (!operation::is_of_a_reading(off.error())) throw BadInput(off.error());
    console.progress << fmt::format("{}: {}; again\n", code(off.error().reason),
                                    without_control_characters(off.error().message))
                     << std::flush;
  }
}

}  // namespace helicarm::cli
