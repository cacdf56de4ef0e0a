// SPDX-License-Identifier: Apache-2.0
#include "touch_points.h"

#include <fmt/format.h>

#include "helicarm/core/text.h"

namespace helicarm::cli {

void ask_to_touch(const std::string& name, LineInput& input, Console& console) {
  input.discard();
  console.progress << fmt::format("touch \"{}\" with the pointer, hold it still and press Enter\n",
                                  without_control_characters(name))
                   << std::flush;
}

void touch_point(operation::Operation& operation, const std::string& name, LineInput& input,
                 const Ending& ending, Console& console) {
  ask_to_touch(name, input, console);
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
    input.discard();
    console.progress << fmt::format("{}: {}; again\n", code(off.error().reason),
                                    without_control_characters(off.error().message))
                     << std::flush;
  }
}

}  // namespace helicarm::cli
