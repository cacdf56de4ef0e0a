// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/simulation_options.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace helicarm::simulation {
namespace {

/// In the order of the enumerations.
constexpr std::array<std::string_view, 4> kinds = {"accuracy", "tunnels", "flat", "grid"};
constexpr std::array<std::string_view, 3> presets = {"paper-sim", "ii-9in", "flat-panel"};
constexpr std::array<std::string_view, 7> faults = {"decoys",   "wires",    "screws",   "low_dose",
                                                    "shutters", "mirrored", "saturated"};

template <class Value, std::size_t n>
Expected<Value> value_of(const std::array<std::string_view, n>& words, std::string_view word,
                         const char* what) {
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end())
    return fail(Reason::usage, fmt::format("{}: \"{}\" is none of: {}", what, word, fmt::join(words, ", ")));
  return static_cast<Value>(found - words.begin());
}

}  // namespace

std::string_view word(CaseKind kind) { return kinds.at(static_cast<std::size_t>(kind)); }
std::string_view word(Preset preset) { return presets.at(static_cast<std::size_t>(preset)); }
std::string_view word(Fault fault) { return faults.at(static_cast<std::size_t>(fault)); }
Expected<CaseKind> case_kind(std::string_view word) { return value_of<CaseKind>(kinds, word, "kind"); }
Expected<Preset> preset(std::string_view word) { return value_of<Preset>(presets, word, "preset"); }
Expected<Fault> fault(std::string_view word) { return value_of<Fault>(faults, word, "fault"); }

Preset SimulationOptions::machine() const {
  return preset.value_or(kind == CaseKind::flat ? Preset::flat_panel : Preset::ii_9in);
}

bool SimulationOptions::has(Fault fault) const {
  return std::find(faults.begin(), faults.end(), fault) != faults.end();
}

}  // namespace helicarm::simulation
