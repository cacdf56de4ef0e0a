// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command_line.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/phantom/calibrator.h"
#include "progress_line.h"
#include "studies/biplane.h"
#include "studies/biplane_images.h"
#include "studies/calibration_study.h"
#include "studies/centres.h"
#include "studies/design.h"
#include "studies/limit.h"
#include "studies/location.h"
#include "studies/number.h"
#include "studies/rectification_study.h"
#include "studies/uniformity_study.h"

namespace helicarm::cli {

/// Omitted options take the study's defaults.
struct StudyArguments {
  /// number, uniformity, location, biplane, biplane-images, calibration, rectification, design, limit or
  /// centres
  std::string name;
  std::optional<std::size_t> groups;
  std::filesystem::path out = "helicarm-study";
  bool resume = false;
  std::vector<int> balls;
  std::vector<std::string> sigmas;
  std::vector<std::string> readings;
  std::optional<double> fle;
  std::string origin;
  std::optional<int> draws;
  std::string calibrator;
  std::string surface;
  study::BiplaneOptions biplane;               ///< of biplane_fields
  study::CalibrationStudyOptions calibration;  ///< of calibration_fields
};

namespace {

/// Context of a study besides its own options.
struct StudyRun {
  const StudyArguments& arguments;
  Console& console;
  const study::Ranks& ranks;
  study::EngineOptions engine;
};

[[noreturn]] void refuse(const std::string& message) { throw BadInput(Reason::usage, "study: " + message); }

/// The enumeration value with this name.
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

using GivenOptions = std::vector<std::pair<std::string_view, bool>>;

/// Fields that differ from their default.
template <class Options, std::size_t count>
void add_given(GivenOptions& stated, const Options& options,
               const std::array<Field<Options>, count>& fields) {
  for (const Field<Options>& field : fields)
    stated.emplace_back(field.flag, field.get(options) != field.get(Options{}));
}

template <std::size_t count, class Options>
std::vector<std::string_view> flags_of(std::vector<std::string_view> flags,
                                       const std::array<Field<Options>, count>& fields) {
  for (const Field<Options>& field : fields) flags.push_back(field.flag);
  return flags;
}

/// An option that this study does not have is an error.
void only(const StudyArguments& a, const std::vector<std::string_view>& known) {
  GivenOptions stated{{"--balls", !a.balls.empty()},           {"--sigma", !a.sigmas.empty()},
                      {"--reading", !a.readings.empty()},      {"--fle", a.fle.has_value()},
                      {"--origin", !a.origin.empty()},         {"--draws", a.draws.has_value()},
                      {"--calibrator", !a.calibrator.empty()}, {"--surface", !a.surface.empty()}};
  add_given(stated, a.biplane, study::biplane_fields);
  add_given(stated, a.calibration, study::calibration_fields);
  for (const auto& [option, is_given] : stated)
    if (is_given && std::ranges::count(known, option) == 0)
      refuse(fmt::format("{} has no {}; its options are: {}", a.name, option,
                         known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", "))));
}

/// A study's defaults, overridden by the given options.
template <class Options>
Options options_of(const StudyRun& run, Options options = {}) {
  const StudyArguments& a = run.arguments;
  if (a.groups) options.groups = *a.groups;
  options.seed = run.console.seed;
  if constexpr (requires { options.fle; })
    if (a.fle) options.fle = *a.fle;
  if constexpr (requires { options.origin; })
    if (!a.origin.empty())
      options.origin =
          named("--origin", a.origin, std::array{study::WorldOrigin::base, study::WorldOrigin::centre});
  if constexpr (requires { options.sigma; }) {
    if (a.sigmas.size() > 1) refuse(fmt::format("{} takes one --sigma", a.name));
    if (!a.sigmas.empty()) options.sigma = named("--sigma", a.sigmas[0], study::sigma_readings);
  }
  if constexpr (requires { options.balls = 12; }) {  // NOLINT(bugprone-assignment-in-if-condition): required
    if (a.balls.size() > 1) refuse(fmt::format("{} takes one number of --balls", a.name));
    if (!a.balls.empty()) options.balls = a.balls[0];
  }
  return options;
}

template <auto study, class Options>
study::StudyFiles files_by(const StudyRun& run, const Options& options) {
  const auto answer = value_or_throw(study(options, run.engine, run.ranks));
  return run.ranks.leads() ? study::files_of(answer, options) : study::StudyFiles{};
}

/// A study with shared options only.
template <class Options, auto study>
study::StudyFiles run_plain(const StudyRun& run) {
  return files_by<study>(run, options_of<Options>(run));
}

study::StudyFiles run_number(const StudyRun& run) {
  auto options = options_of<study::NumberOptions>(run);
  if (!run.arguments.balls.empty()) options.balls = run.arguments.balls;
  choose(options.sigmas, "--sigma", run.arguments.sigmas, study::sigma_readings);
  choose(options.readings, "--reading", run.arguments.readings, study::pixel_readings);
  return files_by<study::study_number>(run, options);
}

study::StudyFiles run_uniformity(const StudyRun& run) {
  auto options = options_of<study::UniformityOptions>(run);
  if (run.arguments.draws) options.draws = *run.arguments.draws;
  return files_by<study::study_uniformity>(run, options);
}

study::StudyFiles run_location(const StudyRun& run) {
  auto options = options_of<study::LocationOptions>(run);
  if (!run.arguments.calibrator.empty())
    for (const phantom::CalibratorBall& ball :
         value_or_throw(phantom::calibrator_named(run.arguments.calibrator, ".")).balls)
      options.balls.push_back(ball.centre_in_calibrator);
  return files_by<study::study_location>(run, options);
}

study::StudyFiles run_biplane(const StudyRun& run) {
  return files_by<study::study_biplane>(run, options_of(run, run.arguments.biplane));
}

study::StudyFiles run_biplane_images(const StudyRun& run) {
  const StudyArguments& a = run.arguments;
  auto options = options_of<study::BiplaneImagesOptions>(run);
  options.folder = a.out;
  options.tracker_sigma_mm = a.biplane.tracker_sigma_mm;
  options.tracker_sigma_deg = a.biplane.tracker_sigma_deg;
  if (a.calibration.click_sigma_px > 0) options.click_sigma_px = a.calibration.click_sigma_px;
  return files_by<study::study_biplane_images>(run, options);
}

study::StudyFiles run_calibration(const StudyRun& run) {
  auto options = options_of(run, run.arguments.calibration);
  options.folder = run.arguments.out;
  return files_by<study::study_calibration>(run, options);
}

study::StudyFiles run_design(const StudyRun& run) {
  auto options = options_of<study::DesignOptions>(run);
  if (!run.arguments.surface.empty())
    options.surface = named("--surface", run.arguments.surface, study::design_surfaces);
  return files_by<study::study_design>(run, options);
}

struct KnownStudy {
  std::string_view name;
  study::StudyFiles (*run)(const StudyRun&);
  std::vector<std::string_view> options = {};  ///< besides the common ones
};
const std::array<KnownStudy, 10> studies{
    {{"number", run_number, {"--balls", "--sigma", "--reading", "--fle", "--origin"}},
     {"uniformity", run_uniformity, {"--balls", "--sigma", "--fle", "--origin", "--draws"}},
     {"location", run_location, {"--calibrator", "--sigma", "--fle", "--origin"}},
     {"biplane", run_biplane, flags_of({"--balls", "--sigma", "--fle"}, study::biplane_fields)},
     {"biplane-images", run_biplane_images, {"--tracker-mm", "--tracker-deg", "--click"}},
     {"calibration", run_calibration, flags_of({}, study::calibration_fields)},
     {"rectification", run_plain<study::RectificationStudyOptions, study::study_rectification>},
     {"design", run_design, {"--balls", "--surface", "--sigma", "--fle"}},
     {"limit", run_plain<study::LimitOptions, study::study_limit>},
     {"centres", run_plain<study::CentreOptions, study::study_centres>}}};

const KnownStudy& study_named(const std::string& name) {
  std::vector<std::string_view> names;
  for (const KnownStudy& known : studies) {
    if (known.name == name) return known;
    names.push_back(known.name);
  }
  refuse(fmt::format("\"{}\" is none of: {}", name, fmt::join(names, ", ")));
}

}  // namespace

/// Runs a simulated experiment and writes NAME.csv, NAME.json and NAME.svg. The same seed gives the same
/// bytes, whatever the number of threads and ranks.
CommandResult study_command(const StudyArguments& arguments, Console& console) {
  return guarded([&] {
    const KnownStudy& study = study_named(arguments.name);
    const std::filesystem::path& out = arguments.out;
    const study::Ranks ranks;
    if (ranks.leads())
      forget_files(out, {arguments.name + ".csv", arguments.name + ".json", arguments.name + ".svg"});
    value_or_throw(check_can_write(out));
    only(arguments, study.options);
    std::error_code error;
    if (std::filesystem::create_directories(out, error); error)
      throw BadInput(Reason::cannot_write, fmt::format("{}: {}", out.string(), error.message()));
    if (ranks.count() > 1 && ranks.leads() && !console.quiet)
      console.progress << fmt::format("helicarm: {} ranks\n", ranks.count());
    StudyRun run{arguments, console, ranks, {}};
    run.engine.threads = console.threads;
    run.engine.journal = out / (arguments.name + ".partial");
    run.engine.resume = arguments.resume;
    study::StudyFiles files;
    {
      ProgressLine line(console);
      run.engine.progress = [&](double share) { line.notify(share); };
      files = study.run(run);
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

void add_study(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::studies, "study",
                              "The paper's simulations, and the estimators against the Cramer-Rao bound",
                              "helicarm study number --out number\n"
                              "  helicarm study location --calibrator udcsc --out location\n"
                              "  helicarm study limit --groups 10000 --seed 1 --out limit");
  auto& a = arguments_of(command, action, study_command);
  command
      ->add_option("NAME", a.name,
                   "number: FRE and TRE by number of balls (Fig. 5)\n"
                   "uniformity: E(A) against TRE (Fig. 6)\n"
                   "location: TRE by position of the target (Fig. 7)\n"
                   "biplane: the cone against plates on the receiver (Table 1)\n"
                   "biplane-images: the plates from images; leaves biplane-case, a case for run (Table 1)\n"
                   "calibration: ten simulated tests, measured (Table 1, Fig. 14)\n"
                   "rectification: the test grid at ten distances, by ten intensifiers (Figs. 9 to 11)\n"
                   "design: ball positions of least TRE under the rules\n"
                   "limit: error over the Cramer-Rao bound, and coverage of the confidence regions\n"
                   "centres: errors of ball centres under wrong assumptions about the image")
      ->type_name("WORD")
      ->required();
  command
      ->add_option("--groups", a.groups,
                   "Number of trials per setting; centres: number of balls per situation")
      ->check(within(1, 1e6));
  command->add_option("--out", a.out, "Folder for NAME.csv, NAME.json and NAME.svg")->capture_default_str();
  command->add_flag("--resume", a.resume, "Continue an interrupted run that wrote to the same folder");
  command
      ->add_option("--balls", a.balls,
                   "Number of balls; study number takes several, as 6,7,8; uniformity, design and biplane "
                   "(default 8) take one")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(6, 64));
  command
      ->add_option("--sigma", a.sigmas,
                   "Interpretation of N(0, 2.34): std, var, mean_distance, rms_distance; study number takes "
                   "several (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--reading", a.readings,
                   "number: back-projected pixels: calibration_pixels, fresh_noise, exact (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--fle", a.fle, "Value instead of 2.34")->check(within(0, 1000));
  command
      ->add_option("--origin", a.origin,
                   "Origin of the world frame on the cone's axis: base (as published) or centre")
      ->type_name("WORD");
  command->add_option("--draws", a.draws, "uniformity: noise draws to average over")->check(within(1, 1e5));
  command->add_option("--surface", a.surface, "design: balls on the helix, the cone or a dome")
      ->type_name("WORD");
  command->add_option("--calibrator", a.calibrator,
                      "location: name of a built-in or a file (default: random balls)");
  add_fields(command, a.biplane, study::biplane_fields);
  add_fields(command, a.calibration, study::calibration_fields);
}

}  // namespace helicarm::cli
