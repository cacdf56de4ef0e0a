// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/simulation_options.h"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace helicarm::simulation {
namespace {

/// In the order of the enumerators.
constexpr std::array<std::string_view, 4> kinds = {"accuracy", "tunnels", "flat", "grid"};
constexpr std::array<std::string_view, 3> presets = {"paper-sim", "ii-9in", "flat-panel"};
constexpr std::array<std::string_view, 7> faults = {"decoys",   "wires",    "screws",   "low_dose",
                                                    "shutters", "mirrored", "saturated"};
constexpr std::array<std::string_view, 2> responses = {"linear", "log"};

template <class Value, std::size_t n>
Expected<Value> value_of(const std::array<std::string_view, n>& words, std::string_view word,
                         const char* what) {
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end())
    return fail(Reason::usage,
                fmt::format("{}: \"{}\" must be one of: {}", what, word, fmt::join(words, ", ")));
  return static_cast<Value>(found - words.begin());
}

}  // namespace

std::string_view word(CaseKind kind) { return kinds.at(static_cast<std::size_t>(kind)); }
std::string_view word(Preset preset) { return presets.at(static_cast<std::size_t>(preset)); }
std::string_view word(Response response) { return responses.at(static_cast<std::size_t>(response)); }
std::string_view word(Fault fault) { return faults.at(static_cast<std::size_t>(fault)); }
Expected<CaseKind> case_kind(std::string_view word) { return value_of<CaseKind>(kinds, word, "kind"); }
Expected<Preset> preset(std::string_view word) { return value_of<Preset>(presets, word, "preset"); }
Expected<Fault> fault(std::string_view word) { return value_of<Fault>(faults, word, "fault"); }
Expected<Response> response(std::string_view word) { return value_of<Response>(responses, word, "response"); }

Expected<ViewAngles> view_angles(std::string_view text) {
  ViewAngles view;
  const std::size_t colon = text.find(':');
  const std::size_t comma = text.find(',');
  const auto number = [&](std::size_t first, std::size_t last, double& value) {
    const auto [end, error] = std::from_chars(text.data() + first, text.data() + last, value);
    return error == std::errc{} && end == text.data() + last;
  };
  if (colon == text.npos || comma == text.npos || comma < colon ||
      !number(colon + 1, comma, view.angles.primary_deg) ||
      !number(comma + 1, text.size(), view.angles.secondary_deg))
    return fail(Reason::usage, fmt::format("view: \"{}\" is not NAME:PRIMARY,SECONDARY in degrees", text));
  view.name = text.substr(0, colon);
  return view;
}

bool SimulationOptions::logarithmic() const {
  return response.value_or(knee ? Response::logarithmic : Response::linear) == Response::logarithmic;
}

Preset SimulationOptions::c_arm_preset() const {
  return preset.value_or(kind == CaseKind::flat ? Preset::flat_panel : Preset::ii_9in);
}

bool SimulationOptions::has(Fault fault) const {
  return std::find(faults.begin(), faults.end(), fault) != faults.end();
}

}  // namespace helicarm::simulation
