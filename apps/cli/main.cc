// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <iostream>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/pipeline/result.h"

/// " (5da20f9512)", or empty; written at each build by cmake/commit.cmake.
extern const char* const commit_in_brackets;

namespace helicarm::cli {
namespace {

constexpr int internal_error = 1;

int report(const Failure& failure, const Console& console) {
  const int exit = exit_code(failure.reason);
  const std::string view = failure.view.empty() ? std::string{} : failure.view + ": ";
  console.progress << fmt::format("helicarm: {}: {}{}\n", code(failure.reason), view,
                                  without_control_characters(failure.message));
  if (console.json && !console.answered)
    console.out << to_text({{"status", exit == 3 ? "refused" : "failed"},
                            {"failure", pipeline::to_json(failure)}})
                << '\n';
  return exit;
}

int run(int argc, char** argv) {
  Console console{std::cout, std::cerr};
  Action action;
  CLI::App app(
      "helicarm: 3-D points with confidence regions from X-ray images with a calibrator.\n"
      "Research instrument, not a medical device.",
      "helicarm");
  app.footer("Begin with:\n  helicarm demo\nHelp for a command: helicarm COMMAND --help");
  app.set_version_flag("--version", std::string("helicarm " HELICARM_VERSION) + commit_in_brackets);
  app.fallthrough();
  app.require_subcommand(1);
  app.add_flag("--json", console.json, "Print the answer as JSON");
  app.add_flag("--quiet", console.quiet, "Print only failures, and the answer with --json");
  app.add_option("--threads", console.threads, "Threads to use; 0: all cores")->check(within(0, 1024));
  app.add_option("--seed", console.seed, "Seed of the random numbers")
      ->check(within(0, 1e19))
      ->capture_default_str();
  add_commands(app, action);
  try {
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    if (argc > 1 && argv[1][0] != '-' &&
        std::ranges::none_of(commands, [&](const CLI::App* c) { return c->get_name() == argv[1]; }))
      throw CLI::ParseError(fmt::format("\"{}\" is not a command; helicarm --help lists the commands",
                                        without_control_characters(argv[1])),
                            CLI::ExitCodes::ExtrasError);
    if (argc == 1) {
      console.progress << app.help();
      return exit_code(Reason::usage);
    }
    app.parse(argc, argv);
  } catch (const CLI::Success& wish) {
    return app.exit(wish, console.out, console.progress);
  } catch (const CLI::ParseError& error) {
    console.json =
        std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
    std::string message = error.what();
    const auto commands = app.get_subcommands();
    if (!commands.empty()) message += fmt::format(" (see helicarm {} --help)", commands.front()->get_name());
    return report({Reason::usage, std::move(message), {}, {}}, console);
  }
  std::ostream nowhere(nullptr);
  Console heard{console.quiet && !console.json ? nowhere : console.out,
                console.progress,
                console.json,
                console.quiet,
                console.threads,
                console.seed};
  const auto done = action(heard);
  return done ? 0 : report(done.error(), heard);
}

}  // namespace
}  // namespace helicarm::cli

int main(int argc, char** argv) {
  try {
    return helicarm::cli::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "helicarm: internal: " << error.what() << '\n';
  } catch (...) {
    std::cerr << "helicarm: internal: unknown error\n";
  }
  return helicarm::cli::internal_error;
}
