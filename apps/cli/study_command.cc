// SPDX-License-Identifier: Apache-2.0
#include "study_command.h"

#include <array>
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/study/centres.h"
#include "helicarm/study/limit.h"
#include "progress_line.h"

namespace helicarm::cli {
namespace {

/// What a study's run needs beside its own options.
struct StudyRun {
  const StudyArguments& arguments;
  Console& console;
  std::function<void(double share)> progress;
};

StudyFiles run_limit(const StudyRun& run) {
  LimitOptions options;
  if (run.arguments.groups) options.trials = *run.arguments.groups;
  options.seed = run.console.seed;
  options.threads = run.console.threads;
  return files_of(study_limit(options, run.progress), options);
}

StudyFiles run_centres(const StudyRun& run) {
  CentreOptions options;
  if (run.arguments.groups) options.balls = *run.arguments.groups;
  options.seed = run.console.seed;
  options.threads = run.console.threads;
  return files_of(study_centres(options, run.progress), options);
}

using Study = StudyFiles (*)(const StudyRun&);
constexpr std::array<std::pair<std::string_view, Study>, 2> studies{
    {{"limit", run_limit}, {"centres", run_centres}}};

Study study_named(const std::string& name) {
  std::vector<std::string_view> names;
  for (const auto& [known, study] : studies) {
    if (known == name) return study;
    names.push_back(known);
  }
  throw BadInput(Reason::usage, fmt::format("study: \"{}\" is none of: {}", name, fmt::join(names, ", ")));
}

}  // namespace

CommandResult study_command(const StudyArguments& arguments, Console& console) {
  return guarded([&] {
    const Study study = study_named(arguments.name);
    const std::filesystem::path& out = arguments.out;
    std::error_code error;
    if (std::filesystem::create_directories(out, error); error)
      throw BadInput(Reason::cannot_write, fmt::format("{}: {}", out.string(), error.message()));
    StudyFiles files;
    {
      ProgressLine line(console);
      files = study({arguments, console, [&](double share) { line.tell(share); }});
    }
    const std::string json = to_text(files.json) + "\n";
    const auto write = [&](const char* ending, const std::string& text) {
      if (!text.empty()) value_or_throw(write_file(out / (arguments.name + ending), text));
    };
    write(".csv", files.csv);
    write(".json", json);
    write(".svg", files.svg);
    if (console.json)
      console.out << json;
    else if (!console.quiet)
      console.out << files.summary << fmt::format("\n  written to {}\n", out.string());
  });
}

}  // namespace helicarm::cli
