// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "demo_command.h"

namespace helicarm::cli {

void add_demo(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::measure, "demo",
                              "Simulate two X-ray images, measure them and compare with the ground truth",
                              "helicarm demo --out helicarm-demo");
  auto& a = arguments_of(command, action, demo_command);
  command->add_option("--out", a.out, "Folder for the case and its result")->capture_default_str();
}

}  // namespace helicarm::cli
