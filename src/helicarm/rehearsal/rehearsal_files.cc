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

/// Eq. 17 where it was computed.
std::vector<double> in_xrays(std::span<const Rehearsal> rehearsals, char end) {
  std::vector<double> values;
  for (const Rehearsal& rehearsal : rehearsals)
    for (const EndError& error : rehearsal.ends)
      if (error.in_xrays_mm && (end == '*' || error.name.back() == end)) values.push_back(*error.in_xrays_mm);
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
                      {"off_mm", end.off_mm},
                      {"predicted_mm", end.predicted_mm},
                      {"covered", end.covered},
                      {"in_xrays_mm", end.in_xrays_mm ? Json(*end.in_xrays_mm) : Json()}});
  Json cases = Json::array();
  for (const Rehearsal& rehearsal : rehearsals)
    cases.push_back({{"seed", rehearsal.seed},
                     {"attempts", rehearsal.attempts},
                     {"replans", rehearsal.replans},
                     {"corrections", rehearsal.corrections},
                     {"hand_eye_rms_mm", rehearsal.hand_eye_rms_mm}});
  const auto figures = [&](auto values) {
    const auto of = [&](char end) {
      const std::vector<double> errors = values(end);
      return errors.empty() ? Json() : operation::to_json(operation::figures_of(errors));
    };
    return Json{{"start", of('S')}, {"end", of('E')}, {"all", of('*')}};
  };
  return {{"format", "helicarm-rehearsal/1"},
          {"table", figures([&](char end) { return collected(rehearsals, end, &EndError::true_mm); })},
          {"in_xrays", figures([&](char end) { return in_xrays(rehearsals, end); })},
          {"cases", std::move(cases)},
          {"predicted_rms_mm", root_mean_square(collected(rehearsals, '*', &EndError::predicted_mm))},
          {"covered", covered(rehearsals)},
          {"ends", std::move(ends)}};
}

std::string to_csv(std::span<const Rehearsal> rehearsals) {
  std::string csv = "seed,name,true_mm,measured_mm,predicted_mm,covered,in_xrays_mm,attempts\n";
  for (const Rehearsal& rehearsal : rehearsals)
    for (const EndError& end : rehearsal.ends)
      csv += fmt::format("{},{},{},{},{},{},{},{}\n", rehearsal.seed, end.name, end.true_mm, end.measured_mm,
                         end.predicted_mm, int(end.covered),
                         end.in_xrays_mm ? fmt::format("{}", *end.in_xrays_mm) : "", rehearsal.attempts);
  return csv;
}

std::string table_of(std::span<const Rehearsal> rehearsals) {
  const auto start = operation::figures_of(collected(rehearsals, 'S', &EndError::true_mm));
  const auto end = operation::figures_of(collected(rehearsals, 'E', &EndError::true_mm));
  const auto by_eq_17 = [&](char which, double operation::ErrorFigures::*figure) {
    const std::vector<double> errors = in_xrays(rehearsals, which);
    return errors.empty() ? "-" : fmt::format("{:.2f}", operation::figures_of(errors).*figure);
  };
  const auto all = collected(rehearsals, '*', &EndError::true_mm);
  std::string text = fmt::format(
      "Positioning errors, mm, of {} tunnel ends: true distance from the tool's axis, and Eq. 17 in the "
      "X-ray "
      "images\n"
      "          start     end   | Eq. 17: start   end   | paper: start   end\n",
      all.size());
  const auto row = [&](const char* name, double operation::ErrorFigures::*figure, const char* paper) {
    text += fmt::format("  {:<5} {:>7.2f} {:>7.2f}   |       {:>7} {:>5}   | {}\n", name, start.*figure,
                        end.*figure, by_eq_17('S', figure), by_eq_17('E', figure), paper);
  };
  row("max", &operation::ErrorFigures::max, "        1.55  1.89");
  row("min", &operation::ErrorFigures::min, "        0.34  0.19");
  row("mean", &operation::ErrorFigures::mean, "        0.81  0.88");
  row("SD", &operation::ErrorFigures::sd, "        0.45  0.55   (published as RMS)");
  row("RMS", &operation::ErrorFigures::rms, "        0.93  1.04   (from its mean and SD)");
  int attempts = 0, replans = 0;
  for (const Rehearsal& rehearsal : rehearsals) {
    attempts += rehearsal.attempts;
    replans += rehearsal.replans;
  }
  text += fmt::format(
      "  mean of all {:.2f}; RMS {:.2f}, predicted {:.2f}; {} of {} within their 95 % ellipses; {} attempts "
      "for {} operations, {} orders planned again\n",
      operation::figures_of(all).mean, root_mean_square(all),
      root_mean_square(collected(rehearsals, '*', &EndError::predicted_mm)), covered(rehearsals), all.size(),
      attempts, rehearsals.size(), replans);
  return text;
}

}  // namespace helicarm::rehearsal
