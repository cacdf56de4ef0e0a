// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "helicarm/core/output.h"
#include "helicarm/guidance/guide.h"
#include "helicarm/guidance/poses.h"
#include "helicarm/guidance/tunnel.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::pipeline {

/// Descriptions (core/output.h) of what result.json and registration.json have in common.

template <class Output>
void describe_failure(Output& output, const Failure& failure) {
  output.value(
      "code", [&] { return code(failure.reason); }, "of the [reason](reasons.md)");
  output.value("message", failure.message, "for people");
  output.value(
      "view", [&] { return failure.view.empty() ? std::nullopt : std::optional(failure.view); },
      "which it concerns; `null`: all of them");
  output.value("figures", failure.figures, "name and number of what led to it");
}

template <class Output>
void describe_failures(Output& output, const char* key, const auto& failures, const char* help) {
  output.list(key, failures, help, [](auto& row, const Failure& failure) { describe_failure(row, failure); });
}

/// "status" and "failure" of a file.
template <class Output>
void describe_verdict(Output& output, const std::optional<Failure>& failure, bool is_refused) {
  static constexpr std::array<std::string_view, 2> words{"ok", "refused"};
  output.word(
      "status", [&] { return words[is_refused ? 1 : 0]; }, words, "");
  output.object_of("failure", failure, "`null`, or why it was refused",
                   [](auto& row, const Failure& why) { describe_failure(row, why); });
}
template <class Output>
void describe_verdict(Output& output, const std::optional<Failure>& failure) {
  describe_verdict(output, failure, failure.has_value());
}

template <class Output>
void describe_place(Output& output, const guidance::Place& place) {
  output.value("xyz_mm", place.propagated.point, "position");
  output.value("covariance_mm2", place.covariance, "of the position");
  output.value(
      "error_95_mm", [&] { return localization::length_at_95(place.covariance); },
      "length that 95 % of errors do not exceed");
}

/// Coordinates and covariances in bones and tool, null where not known. Of the knee's bones also by their own
/// keys, if the case has them.
template <class Output>
void describe_in_frames(Output& output, const guidance::PointInFrames* place,
                        const std::vector<guidance::Bone>& bones) {
  static constexpr std::array in{"in_femur", "in_tibia"};
  static constexpr std::array covariance_in{"covariance_in_femur_mm2", "covariance_in_tibia_mm2"};
  output.map(
      "in_bones", [&] { return place ? place->in_bones : decltype(place->in_bones)(); },
      "of each bone in which it is known",
      [](auto& row, const guidance::Place& in_bone) { describe_place(row, in_bone); });
  const auto add = [&](bool present, const char* key, const char* covariance_key,
                       const guidance::Place* const at) {
    output.value_where(
        present, key, output::if_set(at, &guidance::Place::point),
        "position and its covariance in this frame; of the knee's bones only where the case names them so");
    output.value_where(present, covariance_key, output::if_set(at, &guidance::Place::covariance), "likewise");
  };
  const std::vector<guidance::Bone> knee = guidance::knee_bones();
  for (std::size_t i = 0; i < in.size(); ++i)
    add(std::ranges::find(bones, knee[i]) != bones.end(), in[i], covariance_in[i],
        place ? place->in(knee[i]) : nullptr);
  add(true, "in_tool", "covariance_in_tool_mm2", place && place->in_tool ? &*place->in_tool : nullptr);
}

/// Both ends of a tunnel in a bone.
struct TunnelByBone {
  const guidance::Place* start = nullptr;
  const guidance::Place* end = nullptr;
};

/// Bones in which both ends are known.
std::vector<std::pair<guidance::Bone, TunnelByBone>> ends_in_bones(const guidance::Tunnel& tunnel);

template <class Output>
void describe_tunnel(Output& output, const guidance::Tunnel& tunnel) {
  using guidance::Tunnel;
  output.value("name", tunnel.name, "of the tunnel");
  output.map(
      "in_bones", [&] { return ends_in_bones(tunnel); }, "of each bone in which both ends are known",
      [](auto& row, const TunnelByBone& ends) {
        const auto add = [&](const char* key, const guidance::Place* end) {
          static const guidance::Place none{};
          row.object(key, true, "as a point's",
                     [&](auto& place) { describe_place(place, end ? *end : none); });
        };
        add("start", ends.start);
        add("end", ends.end);
      });
  output.value("start_in_tool", tunnel.start_in_tool, "mm");
  output.value("end_in_tool", tunnel.end_in_tool, "mm");
  output.value("axis_in_tool", tunnel.axis_in_tool, "unit vector from start to end");
  output.value("length_mm", tunnel.length_mm, "from start to end");
  output.value("length_sigma_mm", tunnel.length_sigma_mm, "standard deviation");
  output.value(
      "axis_sigma_deg", [&] { return tunnel.axis_sigma_deg(); },
      "standard deviation of the axis: square root of the trace of its covariance");
  output.value("axis_covariance", tunnel.axis_covariance,
               "rad^2, perpendicular to the axis; includes pixels, calibration and tracker");
}

}  // namespace helicarm::pipeline
