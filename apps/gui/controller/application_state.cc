// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/application_state.h"

#include <algorithm>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {

bool is_operation(const ApplicationState& state) {
  return state.source == Source::virtual_or || state.source == Source::devices;
}

bool awaits_confirmation(const ApplicationState& state) {
  return is_operation(state) && state.registration && !state.registration->refused() && !state.is_confirmed;
}

bool can_register(const ApplicationState& state) {
  return state.has_models && state.measured && !state.result->failure;
}

std::shared_ptr<const case_registration::CaseRegistration> movable_models(const ApplicationState& state) {
  return state.registration ? state.registration : state.at_starts;
}

bool is_placed(const ApplicationState& state, std::size_t model) {
  return !state.registration && model < state.models.size() &&
         std::ranges::find(state.starts_by_hand, state.models[model].name, &operation::ModelStart::model) !=
             state.starts_by_hand.end();
}

bool has_poses_by_hand(const ApplicationState& state) {
  return state.nudged || (!state.registration && !state.starts_by_hand.empty());
}

std::string missing_view(const ApplicationState& state) {
  for (const pipeline::ViewResult& view : state.result->views)
    if (!view.xray_image) return view.name;
  return state.views.empty() ? "" : state.views.front();
}

const pipeline::Pick* pick_of(const ApplicationState& state, const std::string& point,
                              const std::string& view) {
  const auto pick = std::ranges::find_if(
      state.picks, [&](const pipeline::Pick& other) { return other.name == point && other.view == view; });
  return pick == state.picks.end() ? nullptr : &*pick;
}

const Failure* failure_of(const ApplicationState& state, const std::string& point, const std::string& view) {
  const auto failed = std::ranges::find_if(state.failed_picks, [&](const FailedPick& one) {
    return one.pick.name == point && one.pick.view == view;
  });
  return failed == state.failed_picks.end() ? nullptr : &failed->why;
}

bool is_picked(const std::vector<pipeline::Pick>& picks, const std::vector<std::string>& views,
               const std::string& point) {
  const auto picked = std::ranges::count_if(picks, [&](const pipeline::Pick& pick) {
    return pick.name == point && std::ranges::find(views, pick.view) != views.end();
  });
  return picked >= std::min<std::ptrdiff_t>(2, std::ssize(views));
}

namespace {

std::optional<WantedPick> missing_pick(const ApplicationState& state, const std::string& point,
                                       std::optional<guidance::Bone> bone) {
  std::vector<pipeline::Pick> good;
  for (const pipeline::Pick& pick : state.picks)
    if (failure_of(state, pick.name, pick.view) == nullptr) good.push_back(pick);
  if (is_picked(good, state.views, point)) return std::nullopt;
  for (const std::string& view : state.views) {
    if (const Failure* failed = failure_of(state, point, view)) return WantedPick{point, view, bone, *failed};
    if (pick_of(state, point, view) == nullptr) return WantedPick{point, view, bone, {}};
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::string> ends_to_pick(const operation::OperationTunnel& tunnel) {
  return tunnel.of_model ? std::vector<std::string>{} : std::vector{tunnel.start, tunnel.end};
}

bool may_guide(const ApplicationState& state, const operation::OperationTunnel& tunnel) {
  return !tunnel.of_model || (state.is_confirmed && !state.nudged);
}

WantedPick wanted_end(const operation::OperationTunnel& tunnel, const std::string& end) {
  return {end, "", tunnel.bone.empty() ? std::nullopt : std::optional(tunnel.bone), {}};
}

std::optional<WantedPick> next_pick(const ApplicationState& state) {
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    for (const std::string& point : ends_to_pick(tunnel))
      if (const auto missing = missing_pick(state, point, wanted_end(tunnel, point).bone)) return missing;
  return std::nullopt;
}

std::optional<WantedPick> next_landmark(const ApplicationState& state) {
  for (const std::string& point : state.landmarks)
    if (const auto missing = missing_pick(state, point, {})) return missing;
  return std::nullopt;
}

bool is_unpicked(const ApplicationState& state, const operation::OperationTunnel& tunnel) {
  return std::ranges::none_of(state.picks, [&](const pipeline::Pick& pick) {
    return pick.name == tunnel.start || pick.name == tunnel.end;
  });
}

std::optional<pipeline::BoneLabel> bone_of(const ApplicationState& state, const std::string& point) {
  for (const pipeline::Pick& pick : state.picks)
    if (pick.name == point && pick.bone) return pick.bone;
  const auto stated = state.bones_of.find(point);
  return stated == state.bones_of.end() ? std::nullopt : std::optional(stated->second);
}

void complete_landmarks(ApplicationState& state) {
  const auto is_end = [&](const std::string& point) {
    return std::ranges::any_of(state.tunnels, [&](const operation::OperationTunnel& tunnel) {
      return tunnel.start == point || tunnel.end == point;
    });
  };
  for (const pipeline::Pick& pick : state.picks)
    if (!is_end(pick.name) && std::ranges::find(state.landmarks, pick.name) == state.landmarks.end())
      state.landmarks.push_back(pick.name);
}

}  // namespace helicarm::gui
