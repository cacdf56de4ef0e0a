// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/records.h"

#include "helicarm/geometry/view_json.h"

namespace helicarm::operation {
namespace {

constexpr Range any_place{-1e6, 1e6};

}  // namespace

Json to_json(const tracker::HandEye& hand_eye) {
  return {{"flange_from_marker", geometry::json_rows(hand_eye.flange_from_marker.matrix())},
          {"tracker_from_base", geometry::json_rows(hand_eye.tracker_from_base.matrix())},
          {"covariance", geometry::json_rows(hand_eye.covariance)},
          {"rms_mm", hand_eye.rms_mm},
          {"rms_deg", hand_eye.rms_deg}};
}

Json to_json(const std::vector<tracker::HandEyePair>& pairs) {
  Json list = Json::array();
  for (const tracker::HandEyePair& pair : pairs)
    list.push_back({{"base_from_flange", geometry::json_rows(pair.base_from_flange.matrix())},
                    {"tracker_from_marker", geometry::json_rows(pair.tracker_from_marker.matrix())}});
  return list;
}

Expected<std::vector<tracker::HandEyePair>> hand_eye_pairs_from(const Json& json, const std::string& origin) {
  return guarded([&] {
    if (!json.is_array()) throw BadInput(Reason::bad_value, origin + ": pairs must be a list");
    std::vector<tracker::HandEyePair> pairs;
    for (const Json& entry : json) {
      JsonReader reader(entry, origin);
      pairs.push_back({geometry::exact_pose_from(reader, "base_from_flange", any_place),
                       geometry::exact_pose_from(reader, "tracker_from_marker", any_place)});
      reader.finish();
    }
    return pairs;
  });
}

Json to_json(const std::vector<robot::Miss>& loop) {
  Json misses = Json::array();
  for (const robot::Miss& miss : loop)
    misses.push_back(
        {{"distance_mm", miss.distance_mm}, {"turn_deg", miss.turn_deg}, {"sigma_mm", miss.sigma_mm}});
  return misses;
}

Json to_json(const EndMiss& end) {
  return {{"across_mm", geometry::json_list(end.across_mm)},
          {"covariance_mm2", geometry::json_rows(end.covariance)},
          {"distance_mm", end.distance_mm()},
          {"predicted_mm", end.predicted_mm()}};
}

Json to_json(const TunnelOutcome& outcome) {
  return {{"tunnel", outcome.tunnel}, {"start", to_json(outcome.start)}, {"end", to_json(outcome.end)}};
}

Json joints_json(const robot::Joints& joints) { return {{"joints_rad", geometry::json_list(joints)}}; }

}  // namespace helicarm::operation
