// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/simulation/ball_sizes.h"
#include "helicarm/simulation/rotation.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/read_volume.h"
#include "named_files.h"
#include "simulated_ct.h"

namespace helicarm::cli {

/// `helicarm simulate DIR`: a case with known ground truth from `console.seed`.
struct SimulateArguments {
  std::filesystem::path folder;
  std::string kind = "accuracy";  ///< accuracy, tunnels, flat or grid
  std::string preset;             ///< paper-sim, ii-9in or flat-panel; empty: by kind
  int size = 1024;                ///< 512 or 1024 pixels per side
  int bits = 12;                  ///< 8, 10, 12, 14 or 16
  bool knee = true;
  std::string calibrator;     ///< a built-in or a file; empty: udcsc with check targets
  std::string plate;          ///< a built-in or a file; empty: plate48
  std::string response;       ///< linear or log; empty: log with the knee
  std::optional<int> frames;  ///< of a rotational run; none: views
  std::optional<double> arc_deg, flex_mm, jitter_mm;
  std::vector<std::string> views;         ///< NAME:PRIMARY,SECONDARY (deg); none: AP and LAT
  std::optional<std::uint64_t> arm_seed;  ///< none: the seed
  CtArguments ct;
  /// decoys, wires, screws, low_dose, shutters, mirrored, saturated, or lost:LABEL for a missing ball
  std::vector<std::string> faults;
  std::vector<double> distances_mm;  ///< kind grid: from the receiver to the wires; none: 45 mm
};

namespace {

using simulation::Visibility;

simulation::SimulationOptions options_from(const SimulateArguments& arguments, const Console& console) {
  simulation::SimulationOptions options;
  options.seed = console.seed;
  options.kind = value_or_throw(simulation::case_kind(arguments.kind));
  if (!arguments.preset.empty()) options.preset = value_or_throw(simulation::preset(arguments.preset));
  options.size = arguments.size;
  options.bits = arguments.bits;
  options.knee = arguments.knee;
  options.threads = console.threads;
  if (!arguments.response.empty())
    options.response = value_or_throw(simulation::response(arguments.response));
  for (const std::string& view : arguments.views)
    options.views.push_back(value_or_throw(simulation::view_angles(view)));
  options.arm_seed = arguments.arm_seed;
  if (!arguments.distances_mm.empty()) {
    if (options.kind != simulation::CaseKind::grid)
      throw BadInput(Reason::usage, "simulate: --distance requires --kind grid");
    options.grid_distances_mm = arguments.distances_mm;
  }
  if (!arguments.calibrator.empty()) options.calibrator = calibrator_from(arguments.calibrator);
  if (!arguments.plate.empty()) options.plate = plate_from(arguments.plate);
  if (options.calibrator && options.kind == simulation::CaseKind::grid)
    throw BadInput(Reason::usage, "simulate: --calibrator cannot be combined with --kind grid");
  if (!arguments.ct.path.empty() && !arguments.knee)
    throw BadInput(Reason::usage, "simulate: --no-knee cannot be combined with --ct");
  if (!arguments.ct.path.empty() && options.kind == simulation::CaseKind::grid)
    throw BadInput(Reason::usage, "simulate: --ct cannot be combined with --kind grid");
  options.ct = ct_from(arguments.ct, console);
  constexpr std::string_view lost = "lost:";
  for (const std::string& fault : arguments.faults)
    if (fault.starts_with(lost))
      options.lost_balls.push_back(fault.substr(lost.size()));
    else
      options.faults.push_back(value_or_throw(simulation::fault(fault)));
  return options;
}

std::optional<simulation::Rotation> rotation_from(const SimulateArguments& arguments) {
  if (!arguments.frames) {
    if (arguments.arc_deg || arguments.flex_mm || arguments.jitter_mm)
      throw BadInput(Reason::usage, "simulate: --arc, --flex and --jitter require --run");
    return std::nullopt;
  }
  simulation::Rotation rotation;
  rotation.frames = *arguments.frames;
  rotation.arc_deg = arguments.arc_deg.value_or(rotation.arc_deg);
  rotation.flex_mm = arguments.flex_mm;
  rotation.jitter_mm = arguments.jitter_mm.value_or(rotation.jitter_mm);
  return rotation;
}

Json summary(const SimulateArguments& arguments, const simulation::SimulatedCase& simulated) {
  Json json = {{"folder", arguments.folder.string()},
               {"kind", arguments.kind},
               {"preset", simulation::word(simulated.options.c_arm_preset())},
               {"seed", simulated.options.seed},
               {"views", Json::array()}};
  for (const simulation::SimulatedView& view : simulated.views) {
    const auto clear = [](const std::vector<simulation::TruePoint>& points) {
      return std::ranges::count(points, Visibility::clear, &simulation::TruePoint::visibility);
    };
    Json entry = {{"name", view.true_view.name}};
    if (simulated.options.kind == simulation::CaseKind::grid)
      entry.update({{"clear_crosses", clear(view.crosses)}, {"crosses", view.crosses.size()}});
    else
      entry.update({{"clear_balls", clear(view.balls)}, {"balls", view.balls.size()}});
    json["views"].push_back(std::move(entry));
  }
  return json;
}

}  // namespace

CommandResult simulate_command(const SimulateArguments& arguments, Console& console) {
  return guarded([&] {
    value_or_throw(simulation::check_case_folder(arguments.folder));
    simulation::forget_case(arguments.folder);
    const simulation::SimulationOptions options = options_from(arguments, console);
    const auto rotation = rotation_from(arguments);
    const simulation::SimulatedCase simulated = [&] {
      if (rotation) {
        auto run = value_or_throw(simulation::simulate_run(options, *rotation));
        value_or_throw(simulation::write_run(arguments.folder, run));
        return std::move(run.images);
      }
      auto images = value_or_throw(simulation::simulate_case(options));
      value_or_throw(simulation::write_case(arguments.folder, images));
      return images;
    }();
    const std::vector<Warning> warnings = simulation::ball_size_warnings(simulated);
    print_warnings(warnings, console);
    Json written = summary(arguments, simulated);
    written["warnings"] = pipeline::json_list_of(warnings);
    if (console.json) {
      console.out << to_text(written) << '\n';
      return;
    }
    if (console.quiet) return;
    console.out << fmt::format("{}: case of kind {}, preset {}, seed {}\n", arguments.folder.string(),
                               arguments.kind, simulation::word(options.c_arm_preset()), options.seed);
    if (rotation) {
      const auto clear = [](const Json& view) { return view["clear_balls"].get<int>(); };
      const auto [least, most] = std::ranges::minmax(written["views"], {}, clear);
      console.out << fmt::format(
          "  RUN.dcm  {} images over {:g} degrees, {} to {} of {} balls unobstructed\n", rotation->frames,
          rotation->arc_deg, clear(least), clear(most), least["balls"].get<int>());
      console.out << fmt::format("  case.json, calibrator.json, {}truth.json\n",
                                 simulated.plate ? "plate.json, " : "");
      return;
    }
    const bool grid = options.kind == simulation::CaseKind::grid;
    const std::string things = grid ? "crosses" : "balls";
    for (const Json& view : written["views"]) {
      console.out << fmt::format("  {}.dcm", view["name"].get<std::string>());
      if (view[things].get<int>() > 0)
        console.out << fmt::format("  {} of {} {} unobstructed", view["clear_" + things].get<int>(),
                                   view[things].get<int>(), things);
      console.out << '\n';
    }
    console.out << fmt::format("  {}{}truth.json\n", grid ? "" : "case.json, calibrator.json, ",
                               simulated.plate ? "plate.json, " : "");
  });
}

void add_simulate(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::studies, "simulate",
                  "Simulate a case with known ground truth: X-ray images of a knee with the calibrator",
                  "helicarm simulate my-case --kind tunnels --seed 7\n"
                  "  helicarm simulate my-case --calibrator my-phantom.json --plate my-plate.json\n"
                  "  helicarm simulate my-run --preset flat-panel --run 133 --arc 200 --flex 3");
  auto& a = arguments_of(command, action, simulate_command);
  command->add_option("DIR", a.folder, "Folder for the case and truth.json")->required();
  command
      ->add_option("--kind", a.kind,
                   "accuracy: AP and lateral image, five check targets\n"
                   "tunnels: balls at the tunnels' ends, tracker and tool\n"
                   "flat: as accuracy, on a flat panel\n"
                   "grid: the test grid of wires (3.1), for rectify --test-grid")
      ->type_name("WORD")
      ->capture_default_str();
  command
      ->add_option("--distance", a.distances_mm,
                   "grid: distance of the wires from the receiver, mm; one value gives GRID.dcm (default: "
                   "45), 30,60,90 give GRID-30.dcm and so on")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(20, 500));
  command
      ->add_option(
          "--preset", a.preset,
          "The C-arm; pixel sizes are those of images with 1024 px per side\n"
          "paper-sim: the paper's simulation (2.3.3): f 900 mm, 0.15 mm pixels, AP and lateral at 800 mm, "
          "no distortion, no plate\n"
          "ii-9in: 9 inch intensifier, 997 mm, 0.2295 mm: plate, distortion, sag (default)\n"
          "flat-panel: 1020 mm, 0.29 mm: sag, no distortion (default of kind flat)")
      ->type_name("WORD");
  command
      ->add_option("--run", a.frames,
                   "A rotational run of this many images for sweep, about AP: RUN.dcm with angles per frame")
      ->check(within(2, 1000));
  command
      ->add_option("--arc", a.arc_deg, "run: angle from the first image to the last, degrees (default: 200)")
      ->check(within(1, 360));
  command
      ->add_option("--flex", a.flex_mm,
                   "run: largest displacement of source or detector by the arm's sag, mm (default: as the "
                   "C-arm has it)")
      ->check(within(0, 20));
  command
      ->add_option("--jitter", a.jitter_mm,
                   "run: displacement of source and detector in each image, standard deviation per axis, mm "
                   "(default: 0.03)")
      ->check(within(0, 20));
  command->add_option("--size", a.size, "Pixels per side: 512 or 1024, of a run also 256")
      ->capture_default_str();
  command->add_option("--bits", a.bits, "Stored bits: 8, 10, 12, 14 or 16")->capture_default_str();
  command->add_flag_callback(
      "--no-knee", [&a] { a.knee = false; }, "Without the knee");
  command->add_option(
      "--calibrator", a.calibrator,
      "calibrator.json instead of udcsc and its check targets; the C-arm turns about its balls' "
      "centroid, z along the knee");
  command->add_option("--plate", a.plate,
                      "plate.json instead of plate48; a lattice without dots fills the field");
  command
      ->add_option("--response", a.response,
                   "Response of the grey values: linear or log (default: log with the knee, else linear)")
      ->type_name("WORD");
  command
      ->add_option("--view", a.views,
                   "NAME:PRIMARY,SECONDARY, degrees; repeatable, 2 to 20 (grid: one). AP:0,0 has the source "
                   "below the knee, LAT:90,0 beside it (default: these two, approximately)")
      ->allow_extra_args(false);
  command->add_option("--arm-seed", a.arm_seed, "Seed of the C-arm (default: the seed)")
      ->check(within(0, 1e19));
  add_ct(*command, a.ct);
  command
      ->add_option(
          "--fault", a.faults,
          "decoys, wires, screws, low_dose, shutters, mirrored, saturated, or lost:LABEL; repeatable")
      ->type_name("WORD");
}

}  // namespace helicarm::cli
