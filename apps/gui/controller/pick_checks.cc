// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/pick_checks.h"

#include <algorithm>

#include "helicarm/pipeline/middle.h"
#include "helicarm/pipeline/points.h"

namespace helicarm::gui {
namespace {

/// Nothing if the view shows it; also where that is not known before a calibration.
std::optional<Failure> looked_for(const ApplicationState& state, const pipeline::ViewResult& view,
                                  const pipeline::Pick& pick) {
  if (!view.calibrated || !view.rectification || !view.xray_image || !view.dots) return std::nullopt;
  if (!view.rectification->map.shows(pick.uv_raw))
    return Failure{Reason::not_seen, "the pick lies outside the image", view.name, {}};
  auto seen =
      pipeline::observe_pick(pick, *view.xray_image, view.rectification->map, view.dots->noise,
                             *view.calibrated, pipeline::middle_of(state.calibrator, state.result->views));
  if (seen) return std::nullopt;
  seen.error().view = view.name;
  return seen.error();
}

/// Whether the result holds an observation of this pick.
bool is_observed(const ApplicationState& state, std::size_t view, const pipeline::Pick& pick) {
  if (std::ranges::none_of(state.measured_picks, [&](const auto& other) { return are_same(other, pick); }))
    return false;
  const auto point = std::ranges::find(state.result->points, pick.name, &pipeline::PointResult::name);
  return point != state.result->points.end() && view < point->seen.size() && point->seen[view];
}

}  // namespace

bool are_same(const pipeline::Pick& a, const pipeline::Pick& b) {
  return a.name == b.name && a.view == b.view && a.uv_raw == b.uv_raw && a.snap == b.snap &&
         a.diameter_mm == b.diameter_mm && a.sigma_px == b.sigma_px && a.moves_with == b.moves_with;
}

bool are_same(const std::vector<pipeline::Pick>& a, const std::vector<pipeline::Pick>& b) {
  return std::ranges::is_permutation(
      a, b, [](const pipeline::Pick& one, const pipeline::Pick& other) { return are_same(one, other); });
}

std::vector<FailedPick> failed_picks(const ApplicationState& state, const std::vector<FailedPick>& known) {
  std::vector<FailedPick> failed;
  if (!state.result) return failed;
  const auto& views = state.result->views;
  for (const pipeline::Pick& pick : state.picks) {
    const auto view = std::ranges::find(views, pick.view, &pipeline::ViewResult::name);
    if (view == views.end() || is_observed(state, std::size_t(view - views.begin()), pick)) continue;
    const auto earlier = std::ranges::find_if(
        known, [&](const FailedPick& one) { return are_same(one.pick, pick) && view->calibrated; });
    if (earlier != known.end())
      failed.push_back(*earlier);
    else if (auto why = looked_for(state, *view, pick))
      failed.push_back({pick, *std::move(why)});
  }
  return failed;
}

}  // namespace helicarm::gui
