// SPDX-License-Identifier: Apache-2.0
// The operation's first step: which images are taken, and with which poses.
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/operation/operation.h"
#include "helicarm/operation/records.h"
#include "helicarm/operation/view_of.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm {
namespace {

/// As check_views_apart asks of the calibrated views.
constexpr double least_apart_deg = 30;

/// Of keys that may be empty.
bool differ(const std::string& a, const std::string& b) { return !a.empty() && !b.empty() && a != b; }

}  // namespace

void Operation::told_once(const std::string& warning) {
  if (reported_.insert(warning).second) notify_(Step::acquire, "warning: " + warning);
}

double Operation::held_s(const Acquisition& shown, double arrival_s) const {
  return shown.acquired ? delays_.held_s(*shown.acquired, arrival_s) : 0;
}

/// This image may show that earlier ones were held back: they are to be acquisition again.
void Operation::weigh_delay(const std::string& view, const Acquisition& shown, double arrival_s) {
  if (!shown.acquired)
    return told_once("pictures carry no time of acquisition: one that lies in the C-arm is not noticed");
  delays_.learn(*shown.acquired, arrival_s);
  const auto held_back = [](const std::string& name, double held) {
    return Failure{
        Reason::stale_pose,
        fmt::format("{}: came {:.3g} s later after its acquisition than the quickest picture, limit "
                    "{:g} s: it lay in the C-arm, or the C-arm's clock was set",
                    name, held, longest_held_s),
        name,
        {{"held_s", held}, {"limit_s", longest_held_s}}};
  };
  std::erase_if(views_, [&](const View& earlier) {
    const double held = held_s(earlier.acquisition, earlier.arrival_s);
    if (held <= longest_held_s) return false;
    const Failure why = held_back(earlier.name, held);
    record("refused", {{"view", earlier.name}, {"why", code(why.reason)}, {"figures", why.figures}});
    notify_(Step::acquire, fmt::format("{}; expose it again", why.message));
    result_.reset();
    return true;
  });
  if (const double held = held_s(shown, arrival_s); held > longest_held_s)
    throw BadInput(held_back(view, held));
}

void Operation::refuse_other_views(const std::string& view, const Acquisition& shown) const {
  for (const View& other : views_) {
    if (other.name == view) continue;
    if (shown.instance_key == other.acquisition.instance_key)
      throw BadInput(Reason::views_too_close, fmt::format("{}: is the picture of {}", view, other.name));
    if (differ(shown.patient_key, other.acquisition.patient_key) ||
        differ(shown.study_key, other.acquisition.study_key))
      throw BadInput(Reason::patient_mismatch,
                     fmt::format("{} and {} are of different patients or studies", view, other.name));
    const auto apart = degrees_apart(shown, other.acquisition);
    if (plan_.views.size() == 2 && apart && *apart < least_apart_deg)
      throw BadInput(
          {Reason::views_too_close,
           fmt::format(
               "{} and {}: were shot {:.3g} degrees apart by the positioner's angles, at least {:g} are "
               "needed",
               view, other.name, *apart, least_apart_deg),
           view,
           {{"angle_deg", *apart}, {"limit_deg", least_apart_deg}}});
  }
}

/// And the view's right name.
Acquisition Operation::acquisition_of(std::string& view, const Arrival& arrival, double arrival_s) {
  if (arrival.repeated)
    throw BadInput(Reason::stale_pose, fmt::format("{}: this picture came before; expose anew", view));
  const Acquisition shown = value_or_throw(read_xray_image(arrival.path, view, 1)).acquisition;
  refuse_other_views(view, shown);
  if (const std::string acquired_view = view_of(shown, view, views_to_come());
      acquired_view != view && std::ranges::none_of(views_, [&](const View& other) {
        return !degrees_apart(shown, other.acquisition);
      })) {
    notify_(Step::acquire, fmt::format("{}: came in place of {}, by the positioner's angle of {:g} degrees",
                                       acquired_view, view, *shown.primary_angle_deg));
    view = acquired_view;
  }
  weigh_delay(view, shown, arrival_s);
  return shown;
}

Expected<void> Operation::take(const std::string& wanted, const Arrival& arrival, double arrival_s) {
  return guarded([&] {
    if (std::ranges::find(plan_.views, wanted) == plan_.views.end())
      throw BadInput(Reason::bad_value, fmt::format("{}: is no view of the plan", wanted));
    notify_(Step::acquire, wanted);
    std::string view = wanted;
    const auto acquisition = guarded([&] { return acquisition_of(view, arrival, arrival_s); });
    if (!acquisition) {
      const Failure& why = acquisition.error();
      record(
          "refused",
          {{"view", view}, {"picture", arrival.digest}, {"why", code(why.reason)}, {"figures", why.figures}});
      throw BadInput(why);
    }
    const double coarse_s = acquisition->acquired ? acquisition->acquired->resolution_s : 0;
    const PoseWindow window = window_of_exposure(board_, plan_.tracker, arrival_s, coarse_s);
    const auto seen = poses_of_exposure(window, plan_.tracker);
    record("exposure", {{"view", view},
                        {"picture", arrival.digest},
                        {"held_s", held_s(*acquisition, arrival_s)},
                        {"window", to_json(window)},
                        {"poses", seen ? to_json(*seen) : Json()}});
    const Poses poses = value_or_throw(seen);
    for (const PlannedTunnel& tunnel : plan_.tunnels)
      if (!poses.tracker_from(tunnel.bone))
        throw BadInput(Reason::no_pose,
                       fmt::format("{}: the marker of the {} was not seen during the exposure", view,
                                   plan_.tracker.marker_of(tunnel.bone)));
    std::erase_if(views_, [&](const View& other) { return other.name == view; });
    views_.push_back({view, arrival.path, *acquisition, arrival_s, poses});
    std::ranges::sort(views_, {}, [&](const View& v) { return std::ranges::find(plan_.views, v.name); });
    result_.reset();
  });
}

}  // namespace helicarm
