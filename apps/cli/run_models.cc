// SPDX-License-Identifier: Apache-2.0
#include "run_models.h"

#include <sstream>

#include <fmt/format.h>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/files.h"
#include "register_command.h"

namespace helicarm::cli {
namespace fs = std::filesystem;

CommandResult run_with_models(const RunArguments& arguments, Console& console) {
  return guarded([&] {
    std::ostringstream answer;
    Console own{answer, console.progress, console.json, console.quiet, console.threads, console.seed};
    value_or_throw(run_command(arguments, own));
    if (!console.json) console.out << answer.str() << "\n  models\n";

    RegisterArguments models;
    models.folder = arguments.folder;
    models.out = arguments.out / "registration";
    std::ostringstream registered;
    Console of_models{registered, console.progress, false, console.quiet, console.threads, console.seed};
    const CommandResult done = register_command(models, of_models);
    if (!console.json) console.out << registered.str();
    const auto registration = read_json(models.out / "registration.json");
    if (!registration) return value_or_throw(done);
    value_or_throw(write_file(arguments.out / "registration.json", to_text(*registration) + "\n"));
    const fs::path result_file = arguments.out / "result.json";
    const Json result =
        case_registration::with_tunnels_of_models(value_or_throw(read_json(result_file)), *registration);
    value_or_throw(write_file(result_file, to_text(result) + "\n"));
    value_or_throw(done);
    if (console.json) console.out << to_text(result) << '\n';
  });
}

}  // namespace helicarm::cli
