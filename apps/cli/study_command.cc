// SPDX-License-Identifier: Apache-2.0
#include "study_command.h"

#include <algorithm>
#include <array>
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/study/biplane.h"
#include "helicarm/study/calibration_study.h"
#include "helicarm/study/centres.h"
#include "helicarm/study/design.h"
#include "helicarm/study/limit.h"
#include "helicarm/study/location.h"
#include "helicarm/study/number.h"
#include "helicarm/study/rectification_study.h"
#include "helicarm/study/uniformity_study.h"
#include "progress_line.h"

namespace helicarm::cli {
namespace {

/// What a study's run needs beside its own options.
struct StudyRun {
  const StudyArguments& arguments;
  Console& console;
  const Ranks& ranks;
  EngineOptions engine;
};

[[noreturn]] void refuse(const std::string& message) { throw BadInput(Reason::usage, "study: " + message); }

/// The value of an enumeration that has this name.
template <class Values>
auto named(const char* option, const std::string& name, const Values& values) {
  const auto at = std::ranges::find_if(values, [&](auto value) { return name_of(value) == name; });
  if (at != values.end()) return *at;
  std::vector<std::string_view> names;
  for (const auto value : values) names.push_back(name_of(value));
  refuse(fmt::format("{} \"{}\" is none of: {}", option, name, fmt::join(names, ", ")));
}

template <class Value, class Values>
void choose(std::vector<Value>& chosen, const char* option, const std::vector<std::string>& names,
            const Values& values) {
  if (names.empty()) return;
  chosen.clear();
  for (const std::string& name : names) {
    const Value value = named(option, name, values);
    if (std::ranges::count(chosen, value)) refuse(fmt::format("{} \"{}\" is given twice", option, name));
    chosen.push_back(value);
  }
}

/// An option this study does not know is an error, not a silence.
void only(const StudyArguments& a, std::initializer_list<std::string_view> known) {
  const std::array<std::pair<const char*, bool>, 8> given{{{"--balls", !a.balls.empty()},
                                                           {"--sigma", !a.sigmas.empty()},
                                                           {"--reading", !a.readings.empty()},
                                                           {"--fle", a.fle.has_value()},
                                                           {"--origin", !a.origin.empty()},
                                                           {"--draws", a.draws.has_value()},
                                                           {"--calibrator", !a.calibrator.empty()},
                                                           {"--surface", !a.surface.empty()}}};
  for (const auto& [option, is_given] : given)
    if (is_given && std::ranges::count(known, option) == 0)
      refuse(fmt::format("{} has no {}; its options are: {}", a.name, option,
                         known.size() > 0 ? fmt::format("{}", fmt::join(known, ", ")) : "none"));
}

/// What the paper's experiments share.
template <class Options>
Options common_options(const StudyRun& run) {
  Options options;
  const StudyArguments& a = run.arguments;
  if (a.groups) options.groups = *a.groups;
  options.seed = run.console.seed;
  if (a.fle) options.fle = *a.fle;
  if constexpr (requires { options.origin; })
    if (!a.origin.empty())
      options.origin = named("--origin", a.origin, std::array{WorldOrigin::base, WorldOrigin::centre});
  if constexpr (requires { options.sigma; }) {
    if (a.sigmas.size() > 1) refuse(fmt::format("{} takes one --sigma", a.name));
    if (!a.sigmas.empty()) options.sigma = named("--sigma", a.sigmas[0], sigma_readings);
  }
  return options;
}

StudyFiles run_number(const StudyRun& run) {
  only(run.arguments, {"--balls", "--sigma", "--reading", "--fle", "--origin"});
  auto options = common_options<NumberOptions>(run);
  if (!run.arguments.balls.empty()) options.balls = run.arguments.balls;
  choose(options.sigmas, "--sigma", run.arguments.sigmas, sigma_readings);
  choose(options.readings, "--reading", run.arguments.readings, pixel_readings);
  return files_of(value_or_throw(study_number(options, run.engine, run.ranks)), options);
}

StudyFiles run_uniformity(const StudyRun& run) {
  only(run.arguments, {"--balls", "--sigma", "--fle", "--origin", "--draws"});
  auto options = common_options<UniformityOptions>(run);
  if (run.arguments.balls.size() > 1) refuse("uniformity takes one number of --balls");
  if (!run.arguments.balls.empty()) options.balls = run.arguments.balls[0];
  if (run.arguments.draws) options.draws = *run.arguments.draws;
  const auto groups = value_or_throw(study_uniformity(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(groups, options) : StudyFiles{};
}

StudyFiles run_location(const StudyRun& run) {
  only(run.arguments, {"--calibrator", "--sigma", "--fle", "--origin"});
  auto options = common_options<LocationOptions>(run);
  if (!run.arguments.calibrator.empty())
    for (const CalibratorBall& ball : value_or_throw(calibrator_named(run.arguments.calibrator, ".")).balls)
      options.balls.push_back(ball.centre_in_calibrator);
  const auto map = value_or_throw(study_location(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(map, options) : StudyFiles{};
}

StudyFiles run_biplane(const StudyRun& run) {
  only(run.arguments, {"--sigma", "--fle"});
  const auto options = common_options<BiplaneOptions>(run);
  const auto rows = value_or_throw(study_biplane(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(rows, options) : StudyFiles{};
}

StudyFiles run_calibration(const StudyRun& run) {
  only(run.arguments, {});
  CalibrationStudyOptions options;
  if (run.arguments.groups) options.groups = *run.arguments.groups;
  options.seed = run.console.seed;
  options.folder = run.arguments.out;
  const auto tests = value_or_throw(study_calibration(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(tests, options) : StudyFiles{};
}

StudyFiles run_rectification(const StudyRun& run) {
  only(run.arguments, {});
  RectificationStudyOptions options;
  if (run.arguments.groups) options.groups = *run.arguments.groups;
  options.seed = run.console.seed;
  const auto intensifiers = value_or_throw(study_rectification(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(intensifiers, options) : StudyFiles{};
}

StudyFiles run_design(const StudyRun& run) {
  only(run.arguments, {"--balls", "--surface", "--sigma", "--fle"});
  auto options = common_options<DesignOptions>(run);
  if (run.arguments.balls.size() > 1) refuse("design takes one number of --balls");
  if (!run.arguments.balls.empty()) options.balls = run.arguments.balls[0];
  if (!run.arguments.surface.empty())
    options.surface = named("--surface", run.arguments.surface, design_surfaces);
  const auto answer = value_or_throw(study_design(options, run.engine, run.ranks));
  return run.ranks.leads() ? files_of(answer, options) : StudyFiles{};
}

StudyFiles run_limit(const StudyRun& run) {
  only(run.arguments, {});
  LimitOptions options;
  if (run.arguments.groups) options.trials = int(*run.arguments.groups);
  options.seed = run.console.seed;
  options.threads = run.console.threads;
  if (!run.ranks.leads()) return {};
  const auto rows = study_limit(options, run.engine.progress);
  return files_of(rows, options);
}

StudyFiles run_centres(const StudyRun& run) {
  only(run.arguments, {});
  CentreOptions options;
  if (run.arguments.groups) options.balls = int(*run.arguments.groups);
  options.seed = run.console.seed;
  options.threads = run.console.threads;
  if (!run.ranks.leads()) return {};
  return files_of(study_centres(options, run.engine.progress), options);
}

using Study = StudyFiles (*)(const StudyRun&);
constexpr std::array<std::pair<std::string_view, Study>, 9> studies{{{"number", run_number},
                                                                     {"uniformity", run_uniformity},
                                                                     {"location", run_location},
                                                                     {"biplane", run_biplane},
                                                                     {"calibration", run_calibration},
                                                                     {"rectification", run_rectification},
                                                                     {"design", run_design},
                                                                     {"limit", run_limit},
                                                                     {"centres", run_centres}}};

Study study_named(const std::string& name) {
  std::vector<std::string_view> names;
  for (const auto& [known, study] : studies) {
    if (known == name) return study;
    names.push_back(known);
  }
  refuse(fmt::format("\"{}\" is none of: {}", name, fmt::join(names, ", ")));
}

}  // namespace

CommandResult study_command(const StudyArguments& arguments, Console& console) {
  return guarded([&] {
    const Study study = study_named(arguments.name);
    const std::filesystem::path& out = arguments.out;
    std::error_code error;
    if (std::filesystem::create_directories(out, error); error)
      throw BadInput(Reason::cannot_write, fmt::format("{}: {}", out.string(), error.message()));
    const Ranks ranks;
    if (ranks.count() > 1 && ranks.leads() && !console.quiet)
      console.progress << fmt::format("helicarm: {} ranks\n", ranks.count());
    StudyRun run{arguments, console, ranks, {}};
    run.engine.threads = console.threads;
    run.engine.journal = out / (arguments.name + ".partial");
    run.engine.resume = arguments.resume;
    StudyFiles files;
    {
      ProgressLine line(console);
      run.engine.progress = [&](double share) { line.tell(share); };
      files = study(run);
    }
    if (!ranks.leads()) return;
    const auto write = [&](const char* ending, const std::string& text) {
      if (!text.empty()) value_or_throw(write_file(out / (arguments.name + ending), text));
    };
    const std::string json = to_text(files.json) + "\n";
    write(".csv", files.csv);
    write(".json", json);
    write(".svg", files.svg);
    std::filesystem::remove(run.engine.journal, error);
    if (console.json)
      console.out << json;
    else if (!console.quiet)
      console.out << files.summary << fmt::format("\n  written to {}\n", out.string());
  });
}

}  // namespace helicarm::cli
