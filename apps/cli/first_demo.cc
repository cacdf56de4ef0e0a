// SPDX-License-Identifier: Apache-2.0
// `helicarm demo` alone, with its defaults: what ./run builds first, as it needs a part of the modules only.
#include <iostream>

#include <fmt/format.h>

#include "demo_command.h"

int main() {
  using namespace helicarm;
  try {
    cli::Console console{std::cout, std::cerr};
    const auto done = cli::demo_command({}, console);
    if (done) return 0;
    std::cerr << fmt::format("helicarm: {}: {}\n", code(done.error().reason), done.error().message);
    return exit_code(done.error().reason);
  } catch (const std::exception& error) {
    std::cerr << "helicarm: internal: " << error.what() << '\n';
  }
  return 1;
}
