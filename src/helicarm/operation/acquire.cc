// SPDX-License-Identifier: Apache-2.0
// The first step of an operation: which images are accepted, and the poses of each.
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/operation/case_of.h"
#include "helicarm/operation/operation.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/view_of.h"

namespace helicarm::operation {
namespace {

/// The limit that check_views_apart applies to calibrated views.
constexpr double least_apart_deg = 30;

/// For DICOM keys that may be empty.
bool differ(const std::string& a, const std::string& b) { return !a.empty() && !b.empty() && a != b; }

}  // namespace

void Operation::notify_once(const std::string& warning) {
  if (reported_.insert(warning).second) notify_(Step::acquire, "warning: " + warning);
}

double Operation::held_s(const xray::Acquisition& header, double arrival_s) const {
  return header.acquired ? delays_.held_s(*header.acquired, arrival_s) : 0;
}

/// The new image may show that earlier ones were delayed; these must be acquired again.
void Operation::weigh_delay(const std::string& view, const xray::Acquisition& header, double arrival_s) {
  if (!header.acquired)
    return notify_once("the images carry no acquisition time: an image delayed in the C-arm is not detected");
  delays_.learn(*header.acquired, arrival_s);
  const auto held_back = [](const std::string& name, double held) {
    return Failure{
        Reason::stale_pose,
        fmt::format("{}: arrived {:.3g} s later after its acquisition than the fastest image, limit "
                    "{:g} s: delayed in the C-arm, or the C-arm's clock was set",
                    name, held, longest_held_s),
        name,
        {{"held_s", held}, {"limit_s", longest_held_s}}};
  };
  std::vector<Failure> delayed;
  std::erase_if(views_, [&](const View& earlier) {
    const double held = held_s(earlier.acquisition, earlier.arrival_s);
    if (held <= longest_held_s) return false;
    delayed.push_back(held_back(earlier.name, held));
    return true;
  });
  if (!delayed.empty()) {
    const auto ended = forget_measurement();
    for (const Failure& why : delayed) {
      record(record::Refused{why.view, {}, std::string(code(why.reason)), why.figures});
      notify_(Step::acquire, fmt::format("{}; acquire it again", why.message));
    }
    record_ended(ended);
  }
  if (const double held = held_s(header, arrival_s); held > longest_held_s)
    throw BadInput(held_back(view, held));
}

void Operation::refuse_other_views(const std::string& view, const xray::Acquisition& header) const {
  for (const View& other : views_) {
    if (other.name == view) continue;
    if (header.instance_key == other.acquisition.instance_key)
      throw BadInput(Reason::views_too_close,
                     fmt::format("{}: is the image of {}; acquire this view", view, other.name));
    if (differ(header.patient_key, other.acquisition.patient_key) ||
        differ(header.study_key, other.acquisition.study_key))
      throw BadInput(Reason::patient_mismatch,
                     fmt::format("{} and {} belong to different patients or studies", view, other.name));
    const auto apart = xray::degrees_apart(header, other.acquisition);
    if (plan_.views.size() == 2 && apart && *apart < least_apart_deg)
      throw BadInput(
          {Reason::views_too_close,
           fmt::format(
               "{} and {}: the positioner angles differ by {:.3g} degrees, at least {:g} are required", view,
               other.name, *apart, least_apart_deg),
           view,
           {{"angle_deg", *apart}, {"limit_deg", least_apart_deg}}});
  }
}

/// Sets `view` to the view that the image shows.
xray::Acquisition Operation::acquisition_of(std::string& view, const receiver::Arrival& arrival,
                                            double arrival_s) {
  if (arrival.repeated)
    throw BadInput(Reason::stale_pose,
                   fmt::format("{}: this image was received before; acquire a new one", view));
  const std::string bytes = value_or_throw(received_image(arrival.path, arrival.digest));
  const xray::Acquisition header = value_or_throw(xray::read_dicom(bytes, view, 1)).acquisition;
  refuse_other_views(view, header);
  if (const std::string acquired_view = xray::view_of(header, view, views_to_come());
      acquired_view != view && std::ranges::none_of(views_, [&](const View& other) {
        return !xray::degrees_apart(header, other.acquisition);
      })) {
    notify_(Step::acquire, fmt::format("{}: assigned instead of {} by the positioner angle of {:g} degrees",
                                       acquired_view, view, *header.primary_angle_deg));
    view = acquired_view;
  }
  weigh_delay(view, header, arrival_s);
  return header;
}

/// The image's folder, by its name within that of the session; nothing outside. The image's own name may hold
/// UIDs.
std::optional<std::string> Operation::inbox_of(const std::filesystem::path& image) const {
  const std::filesystem::path inbox = image.parent_path().lexically_relative(folder_);
  if (inbox.empty() || *inbox.begin() == "..") return std::nullopt;
  return inbox.string();
}

Expected<void> Operation::take(const std::string& wanted, const receiver::Arrival& arrival,
                               double arrival_s) {
  return guarded([&] {
    if (std::ranges::find(plan_.views, wanted) == plan_.views.end())
      throw BadInput(Reason::bad_value, fmt::format("{}: is not a view of the plan", wanted));
    notify_(Step::acquire, wanted);
    std::string view = wanted;
    const auto acquisition = guarded([&] { return acquisition_of(view, arrival, arrival_s); });
    if (!acquisition) {
      const Failure& why = acquisition.error();
      record(record::Refused{view, arrival.digest, std::string(code(why.reason)), why.figures});
      throw BadInput(why);
    }
    const double coarse_s = acquisition->acquired ? acquisition->acquired->resolution_s : 0;
    const PoseWindow window = window_of_exposure(board_, plan_.tracker, arrival_s, coarse_s);
    const auto seen = poses_of_exposure(window, plan_.tracker);
    record(record::Exposure{view, arrival.digest, inbox_of(arrival.path), held_s(*acquisition, arrival_s),
                            window, seen ? std::optional(*seen) : std::nullopt});
    const guidance::Poses poses = value_or_throw(seen);
    for (const OperationTunnel& tunnel : plan_.tunnels)
      if (!poses.tracker_from(tunnel.bone))
        throw BadInput(Reason::no_pose,
                       fmt::format("{}: the marker of the {} was not visible during the acquisition", view,
                                   plan_.tracker.marker_of(tunnel.bone)));
    std::erase_if(views_, [&](const View& other) { return other.name == view; });
    views_.push_back({view, arrival.path, arrival.digest, *acquisition, arrival_s, poses});
    std::ranges::sort(views_, {}, [&](const View& v) { return std::ranges::find(plan_.views, v.name); });
    in_place_.clear();
    record_ended(forget_measurement());
  });
}

}  // namespace helicarm::operation
