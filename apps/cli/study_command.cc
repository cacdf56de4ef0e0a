// SPDX-License-Identifier: Apache-2.0
#include "study_command.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/study/limit.h"

namespace helicarm::cli {
namespace {

Json json_of(const std::vector<LimitRow>& rows, const StudyArguments& arguments, std::uint64_t seed) {
  Json json{{"format", "helicarm-study/1"}, {"study", "limit"},
            {"groups", arguments.groups},   {"seed", seed},
            {"version", HELICARM_VERSION},  {"rows", Json::array()}};
  for (const LimitRow& row : rows)
    json["rows"].push_back({{"balls", row.balls},
                            {"sigma_px", row.sigma_px},
                            {"model", row.model},
                            {"place", row.place},
                            {"point", row.point_exact ? "exact" : "noisy"},
                            {"trials", row.trials},
                            {"failures", row.failures},
                            {"bound_mm", row.bound_mm},
                            {"error_mm", row.error_mm},
                            {"ratio", row.efficiency()},
                            {"dlt_mm", row.dlt_mm},
                            {"dlt_ratio", row.dlt_mm / row.bound_mm},
                            {"coverage", row.coverage}});
  return json;
}

std::string table_of(const std::vector<LimitRow>& rows) {
  std::string text = fmt::format("{:>5} {:>9} {:<8} {:<15} {:<6} {:>9} {:>9} {:>6} {:>9} {:>9} {:>9}\n",
                                 "balls", "sigma px", "model", "place", "point", "bound mm", "error mm",
                                 "ratio", "DLT mm", "covered", "failures");
  for (const LimitRow& row : rows)
    text += fmt::format(
        "{:>5} {:>9.2f} {:<8} {:<15} {:<6} {:>9.4f} {:>9.4f} {:>6.3f} {:>9.4f} {:>8.1f}% {:>9}\n", row.balls,
        row.sigma_px, row.model, row.place, row.point_exact ? "exact" : "noisy", row.bound_mm, row.error_mm,
        row.efficiency(), row.dlt_mm, 100 * row.coverage, row.failures);
  return text;
}

}  // namespace

CommandResult study_command(const StudyArguments& arguments, Console& console) {
  if (arguments.name != "limit")
    return fail(Reason::usage, fmt::format("study: \"{}\" is none of: limit", arguments.name));
  return guarded([&] {
    std::error_code error;
    if (std::filesystem::create_directories(arguments.out, error); error)
      throw BadInput(Reason::cannot_write, fmt::format("{}: {}", arguments.out.string(), error.message()));
    const auto tell = [&](double share) {
      if (!console.quiet)
        console.progress << fmt::format("\rhelicarm: {:.0f} % done", 100 * share) << std::flush;
    };
    const auto rows = study_limit({arguments.groups, console.seed, console.threads}, tell);
    if (!console.quiet) console.progress << '\n';
    const Json json = json_of(rows, arguments, console.seed);
    value_or_throw(write_file(arguments.out / "limit.csv", to_csv(rows)));
    value_or_throw(write_file(arguments.out / "limit.json", json.dump(2) + "\n"));
    if (console.json)
      console.out << json.dump(2) << '\n';
    else if (!console.quiet)
      console.out << table_of(rows) << fmt::format("\n  written to {}\n", arguments.out.string());
  });
}

}  // namespace helicarm::cli
