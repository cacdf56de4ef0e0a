// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/rehearsal_files.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/operation/outcome_table.h"

namespace helicarm::rehearsal {
namespace {

std::vector<double> collected(std::span<const Rehearsal> rehearsals, char end, double EndError::*value) {
  std::vector<double> values;
  for (const Rehearsal& rehearsal : rehearsals)
    for (const EndError& error : rehearsal.ends)
      if (end == '*' || error.name.back() == end) values.push_back(error.*value);
  return values;
}

double root_mean_square(const std::vector<double>& values) { return operation::figures_of(values).rms; }

std::size_t covered(std::span<const Rehearsal> rehearsals) {
  std::size_t count = 0;
  for (const Rehearsal& rehearsal : rehearsals)
    count += static_cast<std::size_t>(std::ranges::count(rehearsal.ends, true, &EndError::covered));
  return count;
}

}  // namespace

Json to_json(std::span<const Rehearsal> rehearsals) {
  Json ends = Json::array();
  for (const Rehearsal& rehearsal : rehearsals)
    for (const EndError& end : rehearsal.ends)
      ends.push_back({{"seed", rehearsal.seed},
                      {"name", end.name},
                      {"true_mm", end.true_mm},
                      {"measured_mm", end.measured_mm},
                      {"predicted_mm", end.predicted_mm},
                      {"covered", end.covered},
                      {"in_xrays_mm", end.in_xrays_mm ? Json(*end.in_xrays_mm) : Json()}});
  const auto figures = [&](char end, double EndError::*value) {
    return operation::to_json(operation::figures_of(collected(rehearsals, end, value)));
  };
  return {{"format", "helicarm-rehearsal/1"},
          {"table",
           {{"start", figures('S', &EndError::true_mm)},
            {"end", figures('E', &EndError::true_mm)},
            {"all", figures('*', &EndError::true_mm)}}},
          {"predicted_rms_mm", root_mean_square(collected(rehearsals, '*', &EndError::predicted_mm))},
          {"covered", covered(rehearsals)},
          {"ends", std::move(ends)}};
}

std::string to_csv(std::span<const Rehearsal> rehearsals) {
  std::string csv = "seed,name,true_mm,measured_mm,predicted_mm,covered,in_xrays_mm\n";
  for (const Rehearsal& rehearsal : rehearsals)
    for (const EndError& end : rehearsal.ends)
      csv += fmt::format("{},{},{},{},{},{},{}\n", rehearsal.seed, end.name, end.true_mm, end.measured_mm,
                         end.predicted_mm, int(end.covered),
                         end.in_xrays_mm ? fmt::format("{}", *end.in_xrays_mm) : "");
  return csv;
}

std::string table_of(std::span<const Rehearsal> rehearsals) {
  const auto start = operation::figures_of(collected(rehearsals, 'S', &EndError::true_mm));
  const auto end = operation::figures_of(collected(rehearsals, 'E', &EndError::true_mm));
  const auto all = collected(rehearsals, '*', &EndError::true_mm);
  std::string text = fmt::format(
      "Positioning errors, mm: distance of the tunnel's end from the tool's axis, {} points\n"
      "          start     end   | paper: start   end\n",
      all.size());
  const auto row = [&](const char* name, double operation::ErrorFigures::*figure, const char* paper) {
    text += fmt::format("  {:<5} {:>7.2f} {:>7.2f}   | {}\n", name, start.*figure, end.*figure, paper);
  };
  row("max", &operation::ErrorFigures::max, "        1.55  1.89");
  row("min", &operation::ErrorFigures::min, "        0.34  0.19");
  row("mean", &operation::ErrorFigures::mean, "        0.81  0.88");
  row("SD", &operation::ErrorFigures::sd, "        0.45  0.55   (published as RMS)");
  row("RMS", &operation::ErrorFigures::rms, "        0.93  1.04   (from its mean and SD)");
  text += fmt::format(
      "  mean of all {:.2f}; RMS {:.2f}, predicted {:.2f}; {} of {} within their 95 % ellipses\n",
      operation::figures_of(all).mean, root_mean_square(all),
      root_mean_square(collected(rehearsals, '*', &EndError::predicted_mm)), covered(rehearsals), all.size());
  return text;
}

}  // namespace helicarm::rehearsal
