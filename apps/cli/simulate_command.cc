// SPDX-License-Identifier: Apache-2.0
#include "simulate_command.h"

#include <fmt/format.h>

#include "helicarm/simulation/write_case.h"

namespace helicarm::cli {
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
  constexpr std::string_view lost = "lost:";
  for (const std::string& fault : arguments.faults)
    if (fault.starts_with(lost))
      options.lost_balls.push_back(fault.substr(lost.size()));
    else
      options.faults.push_back(value_or_throw(simulation::fault(fault)));
  return options;
}

Json summary(const SimulateArguments& arguments, const simulation::SimulatedCase& simulated) {
  Json json = {{"folder", arguments.folder.string()},
               {"kind", arguments.kind},
               {"preset", simulation::word(simulated.options.machine())},
               {"seed", simulated.options.seed},
               {"views", Json::array()}};
  for (const simulation::SimulatedView& view : simulated.views) {
    int clear = 0;
    for (const simulation::TruePoint& ball : view.balls) clear += ball.visibility == Visibility::clear;
    json["views"].push_back({{"name", view.shot.name}, {"clear_balls", clear}, {"balls", view.balls.size()}});
  }
  return json;
}

}  // namespace

CommandResult simulate_command(const SimulateArguments& arguments, Console& console) {
  return guarded([&] {
    const simulation::SimulationOptions options = options_from(arguments, console);
    value_or_throw(simulation::check_case_folder(arguments.folder));
    const simulation::SimulatedCase simulated = value_or_throw(simulation::simulate_case(options));
    value_or_throw(simulation::write_case(arguments.folder, simulated));
    const Json written = summary(arguments, simulated);
    if (console.json) {
      console.out << to_text(written) << '\n';
      return;
    }
    if (console.quiet) return;
    console.out << fmt::format("{}: case of kind {}, preset {}, seed {}\n", arguments.folder.string(),
                               arguments.kind, simulation::word(options.machine()), options.seed);
    for (const Json& view : written["views"])
      console.out << fmt::format("  {}.dcm  {} of {} balls clear\n", view["name"].get<std::string>(),
                                 view["clear_balls"].get<int>(), view["balls"].get<int>());
    console.out << fmt::format("  case.json, calibrator.json{}, truth.json\n",
                               simulated.plate ? ", plate.json" : "");
  });
}

}  // namespace helicarm::cli
