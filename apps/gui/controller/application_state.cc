// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/application_state.h"

#include <algorithm>

namespace helicarm::gui {

const pipeline::Pick* pick_of(const ApplicationState& state, const std::string& point,
                              const std::string& view) {
  const auto pick = std::ranges::find_if(
      state.picks, [&](const pipeline::Pick& other) { return other.name == point && other.view == view; });
  return pick == state.picks.end() ? nullptr : &*pick;
}

std::optional<WantedPick> next_pick(const ApplicationState& state) {
  for (const operation::PlannedTunnel& tunnel : state.tunnels)
    for (const std::string& point : {tunnel.start, tunnel.end})
      for (const std::string& view : state.views)
        if (pick_of(state, point, view) == nullptr) return WantedPick{point, view, tunnel.bone};
  return std::nullopt;
}

std::optional<WantedPick> next_landmark(const ApplicationState& state) {
  for (const std::string& point : state.landmarks)
    for (const std::string& view : state.views)
      if (pick_of(state, point, view) == nullptr) return WantedPick{point, view, {}};
  return std::nullopt;
}

void complete_landmarks(ApplicationState& state) {
  const auto is_end = [&](const std::string& point) {
    return std::ranges::any_of(state.tunnels, [&](const operation::PlannedTunnel& tunnel) {
      return tunnel.start == point || tunnel.end == point;
    });
  };
  for (const pipeline::Pick& pick : state.picks)
    if (!is_end(pick.name) && std::ranges::find(state.landmarks, pick.name) == state.landmarks.end())
      state.landmarks.push_back(pick.name);
}

}  // namespace helicarm::gui
