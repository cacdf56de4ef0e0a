// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <iostream>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command.h"
#include "demo_command.h"
#include "detect_command.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/navigation/result.h"
#include "import_command.h"
#include "locate_command.h"
#include "phantom_command.h"
#include "predict_command.h"
#include "rectify_command.h"
#include "run_command.h"
#include "simulate_command.h"
#include "solve_command.h"
#include "study_command.h"
#include "tracker_command.h"

namespace helicarm::cli {
namespace {

constexpr int internal_error = 1;

/// The chosen command with its arguments; set while the command line is parsed.
using Action = std::function<CommandResult(Console&)>;

CLI::App* add_command(CLI::App& app, const char* name, const char* what, const char* example) {
  CLI::App* command = app.add_subcommand(name, what);
  command->footer(std::string("Example:\n  ") + example);
  return command;
}

/// A number within bounds that the message names. CLI11's own checks let NaN pass.
CLI::Validator within(double low, double high) {
  const std::string bounds = fmt::format("{:g} to {:g}", low, high);
  const auto check = [=](const std::string& word) -> std::string {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(word, value) && value >= low && value <= high;
    return good ? std::string{} : fmt::format("{} is not a number of {}", word, bounds);
  };
  return {check, bounds};
}

/// A command whose arguments live as long as its callback.
template <class Arguments>
Arguments& arguments_of(CLI::App* command, Action& action, CommandResult (*run)(const Arguments&, Console&)) {
  auto arguments = std::make_shared<Arguments>();
  command->callback([arguments, run, &action] {
    action = [arguments, run](Console& console) { return run(*arguments, console); };
  });
  return *arguments;
}

void add_run(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "run", "Measure a case: two or more X-rays to points, tunnels and error bars",
                  "helicarm run my-case --out my-result");
  auto& a = arguments_of(command, action, run_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option("--out", a.out, "Folder for result.json, report.html and the overlays")
      ->capture_default_str();
  command->add_option("--method", a.method, "best, or paper: the published recipe")->capture_default_str();
  command->add_option("--max-error", a.max_error_mm, "Refuse when a point may be off by more, mm (95 %)")
      ->check(within(1e-6, 1000));
  command->add_option("--machine", a.machine,
                      "The C-arm's history (JSON): serves as prior, and this case's shots are added to it");
  command->add_flag("--no-report", a.no_report, "Write result.json only");
}

void add_predict(CLI::App& app, Action& action) {
  auto* command = add_command(app, "predict", "How far off a point would be, before it is picked",
                              "helicarm predict my-case --at 0,0,40 --at 60,0,40 --map tre");
  auto& a = arguments_of(command, action, predict_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option("--at", a.at,
                      "x,y,z in the calibrator's frame, mm; may be given again. Default: its middle");
  command->add_option("--sigma-px", a.sigma_px, "Noise of a pick, per axis")
      ->check(within(0, 100))
      ->capture_default_str();
  command->add_option("--max-error", a.max_error_mm, "Limit of the decision, mm (95 %)")
      ->check(within(1e-6, 1000))
      ->capture_default_str();
  command->add_option("--machine", a.machine, "The C-arm's history (JSON), which is left as it is");
  command->add_option("--map", a.map, "Folder for a map about the calibrator: tre.csv, tre.vtk, tre.svg");
  command->add_option("--half", a.half_mm, "The map reaches so far, mm")
      ->check(within(1, 1000))
      ->capture_default_str();
  command->add_option("--step", a.step_mm, "of the map, mm")->check(within(0.5, 100))->capture_default_str();
}

void add_study(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "study", "The paper's simulations, and the estimators against the statistical limit",
                  "helicarm study number --out number\n"
                  "  helicarm study location --calibrator udcsc --out location\n"
                  "  helicarm study limit --groups 10000 --seed 1 --out limit");
  auto& a = arguments_of(command, action, study_command);
  command
      ->add_option("NAME", a.name,
                   "number: FRE and TRE by number of balls (Fig. 5)\n"
                   "uniformity: E(A) against TRE (Fig. 6)\n"
                   "location: TRE by place of the target (Fig. 7)\n"
                   "biplane: the cone against plates on the receiver (Table 1)\n"
                   "calibration: ten simulated tests, measured (Table 1, Fig. 14)\n"
                   "rectification: the test grid at ten distances, by ten intensifiers (Figs. 9 to 11)\n"
                   "design: ball positions of least TRE under the rules\n"
                   "limit: error over the Cramer-Rao bound, and coverage of error bars\n"
                   "centres: what wrong assumptions about a ball's picture cost")
      ->required();
  command->add_option("--groups", a.groups, "Trials of each setting; centres: balls of each situation")
      ->check(within(1, 1e6));
  command->add_option("--out", a.out, "Folder for NAME.csv, NAME.json and NAME.svg")->capture_default_str();
  command->add_flag("--resume", a.resume, "Go on where a run was stopped that wrote to the same folder");
  command->add_option("--balls", a.balls, "number: 6,7,8; uniformity, design: one number")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(6, 64));
  command
      ->add_option(
          "--sigma", a.sigmas,
          "How N(0, 2.34) is read: std, var, mean_distance, rms_distance; number: several (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--reading", a.readings,
                   "number: pixels projected back: calibration_pixels, fresh_noise, exact (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--fle", a.fle, "Instead of 2.34")->check(within(0, 1000));
  command->add_option("--origin", a.origin, "World's origin on the cone's axis: base (as printed) or centre");
  command->add_option("--draws", a.draws, "uniformity: noise draws to average over")->check(within(1, 1e5));
  command->add_option("--surface", a.surface, "design: balls on the helix, the cone or a dome");
  command->add_option("--calibrator", a.calibrator,
                      "location: a built-in's name or a file; else random balls");
}

void add_demo(CLI::App& app, Action& action) {
  auto* command = add_command(app, "demo", "Simulate a pair of X-rays, measure it and compare with the truth",
                              "helicarm demo --out helicarm-demo");
  auto& a = arguments_of(command, action, demo_command);
  command->add_option("--out", a.out, "Folder for the case and its result")->capture_default_str();
}

void add_solve(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "solve", "Calibrate one view from points of known place and their pixels (Eq. 4-7)",
                  "helicarm solve --points points.csv --method ml --json");
  auto& a = arguments_of(command, action, solve_command);
  command->add_option("--points", a.points, "CSV: label,x_mm,y_mm,z_mm,u_px,v_px[,sigma_px]")->required();
  command->add_option("--method", a.method, "dlt, homogeneous or ml")->capture_default_str();
}

void add_locate(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "locate", "Intersect rays of picked pixels in views calibrated before (Eq. 8)",
                  "helicarm locate --calibration my-result/result.json --picks picks.csv --json");
  auto& a = arguments_of(command, action, locate_command);
  command->add_option("--calibration", a.calibration, "result.json of a run")->required();
  command->add_option("--picks", a.picks, "CSV: name,view,u_px,v_px[,sigma_px], rectified pixels")
      ->required();
  command->add_flag("--raw", a.raw, "The picks are raw pixels");
}

void add_rectify(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "rectify", "Undo an intensifier's distortion by its plate, or apply a known map (2.1)",
                  "helicarm rectify AP.dcm --plate plate48 --out rectified\n"
                  "  helicarm rectify --map rectified/map.json --points raw.csv --json\n"
                  "  helicarm rectify GRID.dcm --map rectified/map.json --test-grid 20 --json");
  auto& a = arguments_of(command, action, rectify_command);
  command->add_option("IMAGE", a.image, "DICOM, PNG or TIFF");
  command->add_option("--frame", a.frame, "Which picture of several, from 1")->check(within(1, 100000));
  command->add_option("--plate", a.plate, "plate.json, or plate48");
  command->add_option("--map", a.map, "map.json of an earlier rectification");
  command->add_option("--points", a.points, "CSV: u_px,v_px, raw pixels");
  command->add_flag("--inverse", a.inverse, "The points are rectified pixels; give raw ones");
  command->add_option("--test-grid", a.test_grid_mm, "Pitch of the test grid, mm: report Eq. 14-15")
      ->check(within(0.1, 1000));
  command->add_option("--out", a.out, "Folder for rectified.dcm, inpainted.dcm, map.json and residuals.csv")
      ->capture_default_str();
  command->add_option("--method", a.method, "best, or paper: Hough circles and a quadratic")
      ->capture_default_str();
}

void add_detect(CLI::App& app, Action& action) {
  auto* command = add_command(app, "detect", "Find balls, holes or wire crossings to a fraction of a pixel",
                              "helicarm detect AP.dcm --kind balls --json");
  auto& a = arguments_of(command, action, detect_command);
  command->add_option("IMAGE", a.image, "DICOM, PNG or TIFF")->required();
  command->add_option("--frame", a.frame, "Which picture of several, from 1")->check(within(1, 100000));
  command->add_option("--kind", a.kind, "balls, holes or crosses")->capture_default_str();
}

void add_import(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "import", "Read a projection that another program made: MayaCam 2, NRRD, a matrix",
                  "helicarm import camera.txt --unit cm --json");
  auto& a = arguments_of(command, action, import_command);
  command->add_option("FILE", a.file, "MayaCam 2, NRRD header, or a 3x4 matrix as text or JSON")->required();
  command->add_option("--unit", a.unit, "Unit of length in the file: mm or cm")->capture_default_str();
}

void add_simulate(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, "simulate", "Draw a case with known truth: X-rays of a knee with the calibrator",
                  "helicarm simulate my-case --kind tunnels --seed 7");
  auto& a = arguments_of(command, action, simulate_command);
  command->add_option("DIR", a.folder, "Folder for the case and truth.json")->required();
  command
      ->add_option("--kind", a.kind,
                   "accuracy: AP and lateral picture, five check targets\n"
                   "tunnels: balls at the tunnels' ends, tracker and tool\n"
                   "flat: as accuracy, on a flat panel\n"
                   "grid: the test grid of wires (3.1), for rectify --test-grid")
      ->capture_default_str();
  command
      ->add_option(
          "--distance", a.distances_mm,
          "grid: of the wires from the receiver, mm; one gives GRID.dcm (default: 45), 30,60,90 give "
          "GRID-30.dcm and so on")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(20, 500));
  command->add_option(
      "--preset", a.preset,
      "The C-arm; pixels are those of 1024 a side\n"
      "paper-sim: the paper's simulation (2.3.3): f 900 mm, 0.15 mm pixels, AP and lateral at 800 mm, "
      "no distortion, no plate\n"
      "ii-9in: 9 inch intensifier, 997 mm, 0.2295 mm: plate, distortion, sag (default)\n"
      "flat-panel: 1020 mm, 0.29 mm: sag, no distortion (default of kind flat)");
  command->add_option("--size", a.size, "Pixels a side: 512 or 1024")->capture_default_str();
  command->add_option("--bits", a.bits, "Stored bits: 8, 12 or 16")->capture_default_str();
  command->add_flag("!--no-knee", a.knee, "Leave the knee out");
  command->add_option(
      "--fault", a.faults,
      "decoys, wires, screws, low_dose, shutters, mirrored, saturated, or lost:LABEL; repeatable");
}

void add_tracker_link(CLI::App* command, TrackerLinkArguments& a) {
  command->add_option("PEER", a.peer, "address:port of an OpenIGTLink server")->required();
  command->add_option("--seconds", a.seconds, "End by itself; otherwise when interrupted")
      ->check(within(0, 1e6));
  command->add_flag("--ask", a.options.ask_for_tracking,
                    "Ask for tracking (STT_TDATA), as some servers expect");
}

void add_tracker(CLI::App& app, Action& action) {
  auto* tracker =
      add_command(app, "tracker", "Watch, record or play a tracker (OpenIGTLink); calibrate a pointer",
                  "helicarm tracker watch 127.0.0.1:18944\n"
                  "  helicarm tracker record 127.0.0.1:18944 poses.mha --seconds 20\n"
                  "  helicarm tracker replay poses.mha --port 18944\n"
                  "  helicarm tracker pivot poses.mha --tool PointerToTracker");
  tracker->require_subcommand(1);
  auto* watch = tracker->add_subcommand("watch", "What comes, tool by tool");
  add_tracker_link(watch, arguments_of(watch, action, tracker_watch_command));

  auto* record = tracker->add_subcommand("record", "Into a MetaImage sequence file");
  auto& recorded = arguments_of(record, action, tracker_record_command);
  add_tracker_link(record, recorded);
  record->add_option("FILE", recorded.file, "The file to write")->required();

  auto* replay = tracker->add_subcommand("replay", "A MetaImage sequence file as a tracker, over and over");
  auto& replayed = arguments_of(replay, action, tracker_replay_command);
  replay->add_option("FILE", replayed.file, "The file to play")->required();
  replay->add_option("--port", replayed.options.port, "Port to listen at; 0: any")->capture_default_str();
  replay
      ->add_option("--address", replayed.options.address,
                   "Address to listen at: whoever reaches it may connect")
      ->capture_default_str();
  replay->add_option("--seconds", replayed.seconds, "End by itself; otherwise when interrupted")
      ->check(within(0, 1e6));
  replay->add_flag("--tdata", replayed.as_tracking,
                   "Send TDATA to those who ask instead of TRANSFORM to all");

  auto* pivot = tracker->add_subcommand("pivot", "A pointer's tip from a file of it turning about its tip");
  auto& turned = arguments_of(pivot, action, tracker_pivot_command);
  pivot->add_option("FILE", turned.file, "A MetaImage sequence file")->required();
  pivot->add_option("--tool", turned.tool, "The pointer's name in the file")->required();
}

void add_phantom(CLI::App& app, Action& action) {
  auto* command = add_command(app, "phantom", "Show, check or export the calibrator and the plate",
                              "helicarm phantom show\n  helicarm phantom check calibrator.json\n"
                              "  helicarm phantom export --stl calibrator.stl --svg calibrator.svg");
  auto& a = arguments_of(command, action, phantom_command);
  command->add_option("ACTION", a.action, "show, check or export")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, PhantomAction>{{"show", PhantomAction::show},
                                               {"check", PhantomAction::check},
                                               {"export", PhantomAction::export_files}}))
      ->required();
  command->add_option("NAME_OR_FILE", a.name_or_file,
                      "A built-in's name or a file; udcsc or plate48 without it");
  command->add_flag("--plate", a.plate, "The rectification plate instead of the calibrator");
  command->add_option("--stl", a.stl, "export: the printable body");
  command->add_option("--svg", a.svg, "export: the drawing");
  command->add_option("--file", a.file, "export: calibrator.json or plate.json");
}

int report(const Failure& failure, const Console& console) {
  const int exit = exit_code(failure.reason);
  const std::string view = failure.view.empty() ? std::string{} : failure.view + ": ";
  console.progress << fmt::format("helicarm: {}: {}{}\n", code(failure.reason), view,
                                  without_control_characters(failure.message));
  if (console.json)
    console.out << to_text({{"status", exit == 3 ? "refused" : "failed"}, {"failure", to_json(failure)}})
                << '\n';
  return exit;
}

int run(int argc, char** argv) {
  Console console{std::cout, std::cerr};
  Action action;
  CLI::App app(
      "helicarm: two X-rays of a knee with a plastic cone on it become points in space, with error bars.\n"
      "Research instrument, not a medical device.",
      "helicarm");
  app.footer("Begin with:\n  helicarm demo\nEach command explains itself: helicarm COMMAND --help");
  app.set_version_flag("--version", "helicarm " HELICARM_VERSION);
  app.fallthrough();
  app.require_subcommand(1);
  app.add_flag("--json", console.json, "Print the answer as JSON");
  app.add_flag("--quiet", console.quiet, "Print nothing but failures, and what --json asks for");
  app.add_option("--threads", console.threads, "Threads to use; 0: all cores")->check(within(0, 1024));
  app.add_option("--seed", console.seed, "Seed of whatever is drawn at random")
      ->check(within(0, 1e19))
      ->capture_default_str();
  for (const auto add : {add_demo, add_run, add_predict, add_study, add_solve, add_locate, add_rectify,
                         add_detect, add_import, add_simulate, add_phantom, add_tracker})
    add(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& wish) {
    return app.exit(wish, console.out, console.progress);
  } catch (const CLI::ParseError& error) {
    console.json =
        std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
    return report({Reason::usage, error.what(), {}, {}}, console);
  }
  std::ostream nowhere(nullptr);
  Console heard{console.quiet && !console.json ? nowhere : console.out,
                console.progress,
                console.json,
                console.quiet,
                console.threads,
                console.seed};
  const auto done = action(heard);
  return done ? 0 : report(done.error(), console);
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
