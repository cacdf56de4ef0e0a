// SPDX-License-Identifier: Apache-2.0
#ifdef __linux__
#include <malloc.h>
#endif

#include <algorithm>
#include <functional>
#include <iostream>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/program_version.h"
#include "helicarm/core/text.h"
#include "helicarm/pipeline/result.h"
#include "module_description.h"
#include "module_words.h"

/// " (5da20f9512)", or empty; written at each build by cmake/commit.cmake.
extern const char* const commit_in_brackets;

namespace helicarm::cli {
namespace {

constexpr int internal_error = 1;

int report(const Failure& failure, const Console& console, std::ostream& errors) {
  const int exit = exit_code(failure.reason);
  const std::string view = failure.view.empty() ? std::string{} : failure.view + ": ";
  errors << fmt::format("helicarm: {}: {}{}\n", code(failure.reason), view,
                        without_control_characters(failure.message));
  if (console.json && !console.answered)
    console.out << to_text({{"status", exit == 3 ? "refused" : "failed"},
                            {"failure", pipeline::to_json(failure)}})
                << '\n';
  return exit;
}

/// Large temporaries keep their pages: returning them to the kernel and getting them again takes a sixth of
/// the time of a run with dense plates.
void keep_pages() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 512 << 20);
  mallopt(M_TOP_PAD, 64 << 20);
#endif
}

/// What every command takes.
void describe(CLI::App& app, Console& console) {
  app.description(
      "helicarm: 3-D points with confidence regions from X-ray images with a calibrator.\n"
      "Research instrument, not a medical device.");
  app.footer("Begin with:\n  helicarm demo\nHelp for a command: helicarm COMMAND --help");
  app.set_version_flag("--version", "helicarm " + program_version());
  app.fallthrough();
  app.require_subcommand(1);
  app.add_flag("--json", console.json, "Print the answer as JSON");
  app.add_flag("--quiet", console.quiet, "Print only failures, and the answer with --json");
  app.add_option("--threads", console.threads, "Threads to use; 0: all cores")->check(within(0, 1024));
  app.add_option("--seed", console.seed, "Seed of the random numbers")
      ->check(within(0, 1e19))
      ->capture_default_str();
}

/// The words behind the program's own options.
std::span<const std::string> from_command(const CLI::App& app, std::span<const std::string> words) {
  while (!words.empty() && words.front().starts_with("--")) {
    const std::size_t equals = words.front().find('=');
    const CLI::Option* option = app.get_option_no_throw(words.front().substr(0, equals));
    if (!option) break;
    const int values = equals == std::string::npos ? option->get_expected_min() : 0;
    words = words.subspan(std::min(words.size(), std::size_t(1 + values)));
  }
  return words;
}

/// `COMMAND --xml`: the XML of the command, and true. `--slicer COMMAND ...`: `words` become those of the
/// program's own options.
bool is_answered_as_module(const CLI::App& app, std::vector<std::string>& words, Console& console) {
  console.tags = !words.empty() && words.front() == "--slicer";
  if (console.tags) words.erase(words.begin());
  std::span<const std::string> rest = from_command(app, words);
  const CLI::App* command = command_named(app, rest);
  if (!command) return false;
  if (rest.size() == 1 && rest.front() == "--xml") {
    console.out << module_description(*command);
    return true;
  }
  if (!console.tags) return false;
  std::vector<std::string> own(words.begin(), words.end() - std::ptrdiff_t(rest.size()));
  std::ranges::move(words_of_module(*command, rest), std::back_inserter(own));
  words = std::move(own);
  return false;
}

/// Throws CLI::ParseError for a word that is no command, of the program or of a group of commands.
void check_commands(const CLI::App& app, std::span<const std::string> words) {
  const CLI::App* group = &app;
  std::string path = "helicarm";
  const auto wish = std::ranges::find_if(
      words, [](const std::string& word) { return word == "--help" || word == "-h" || word == "--version"; });
  const bool is_answered = wish != words.end();
  words = words.first(std::size_t(wish - words.begin()));
  for (words = from_command(app, words); !words.empty(); words = from_command(app, words.subspan(1))) {
    const std::string& word = words.front();
    const auto commands = group->get_subcommands([](const CLI::App*) { return true; });
    if (commands.empty() || word.starts_with('-')) return;
    const auto command = std::ranges::find(commands, word, &CLI::App::get_name);
    if (command == commands.end())
      throw CLI::ParseError(fmt::format("\"{}\" is not a command; {} --help lists the commands",
                                        without_control_characters(word), path),
                            CLI::ExitCodes::ExtrasError);
    group = *command;
    path += " " + word;
  }
  if (!is_answered && group != &app && !group->get_subcommands([](const CLI::App*) { return true; }).empty())
    throw CLI::ParseError(fmt::format("no command is given; {} --help lists the commands", path),
                          CLI::ExitCodes::RequiredError);
}

int run(int argc, char** argv) {
  Console console{std::cout, std::cerr};
  Action action;
  CLI::App app({}, "helicarm");
  describe(app, console);
  add_commands(app, action);
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  if (is_answered_as_module(app, words, console)) return 0;
  try {
    check_commands(app, words);
    if (words.empty()) {
      console.progress << app.help();
      return exit_code(Reason::usage);
    }
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::Success& wish) {
    return app.exit(wish, console.out, console.progress);
  } catch (const CLI::ParseError& error) {
    console.json = std::ranges::find(words, "--json") != words.end();
    std::string message = error.what();
    const auto commands = app.get_subcommands();
    if (!commands.empty()) message += fmt::format(" (see helicarm {} --help)", commands.front()->get_name());
    return report({Reason::usage, std::move(message), {}, {}}, console, console.progress);
  }
  std::ostream nowhere(nullptr);
  Console heard{console.quiet && !console.json ? nowhere : console.out,
                console.tags ? console.out : console.progress,  // Slicer shows stderr as an error
                console.json,
                console.quiet,
                console.threads,
                console.seed,
                false,
                console.tags};
  const auto done = action(heard);
  return done ? 0 : report(done.error(), heard, console.progress);
}

}  // namespace
}  // namespace helicarm::cli

int main(int argc, char** argv) {
  try {
    helicarm::program_commit() = commit_in_brackets;
    helicarm::cli::keep_pages();
    return helicarm::cli::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "helicarm: internal: " << error.what() << '\n';
  } catch (...) {
    std::cerr << "helicarm: internal: unknown error\n";
  }
  return helicarm::cli::internal_error;
}
