// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>

#include "helicarm/core/codec.h"
#include "helicarm/operation/freehand.h"

namespace helicarm::operation {

/// `Guidance::decision`, and its sentence. Throws BadInput for a word that is no decision.
void read_decision(JsonReader& reader, std::optional<Failure>& why_not);

template <class Codec, class Errors>
void describe_errors(Codec& codec, Errors& errors) {
  constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};
  const auto describe = [&](auto& inner, auto& error) {
    inner.number("distance_mm", error.distance_mm, any, "of the distance, root of the trace across the axis");
    inner.number("angle_deg", error.angle_deg, any, "of the angle");
  };
  codec.required_object("images", errors.images,
                        "standard deviations by X-ray images or the model's registration", describe);
  codec.required_object("tracker", errors.tracker, "by the tracker, at acquisition and now", describe);
  codec.required_object("tool", errors.tool, "by the tool's calibration", describe);
  codec.required_object("scatter", errors.scatter, "by the scatter of single samples", describe);
}

template <class Codec, class Aim>
void describe_aim(Codec& codec, Aim& aim) {
  constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};
  codec.number("distance_mm", aim.distance_mm, any, "of the tip from the tunnel's axis");
  codec.number("distance_sigma_mm", aim.distance_sigma_mm, any, "root of the trace across the axis");
  codec.number("angle_deg", aim.angle_deg, any, "between drill and axis");
  codec.number("angle_sigma_deg", aim.angle_sigma_deg, any, "standard deviation");
  codec.number("depth_mm", aim.depth_mm, any, "of the tip beyond the entry, negative before it");
  codec.number("depth_sigma_mm", aim.depth_sigma_mm, any, "standard deviation");
  codec.number("length_mm", aim.length_mm, any, "of the tunnel");
  codec.vector("to_axis_mm", aim.to_axis_mm, any, "from the tip to the nearest point of the axis");
  codec.vector("axis", aim.axis, any, "its direction in the tip's frame, z along the drill");
  codec.object("errors", aim.errors, "the causes; records of earlier versions lack them",
               [](auto& inner, auto& errors) { describe_errors(inner, errors); });
}

template <class Codec, class Value>
void describe_guidance(Codec& codec, Value& guidance) {
  constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};
  codec.custom(
      "decision", true, {{"type", "string"}}, "`on_target`, or the code of the reason",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Value>) read_decision(reader, guidance.why_not);
      },
      [&] { return std::optional<Json>(guidance.decision()); });
  codec.custom(
      "message", false, {{"type", "string"}}, "its sentence", [](JsonReader&) {},
      [&] { return std::optional(guidance.why_not ? Json(guidance.why_not->message) : Json()); });
  codec.number("age_s", guidance.age_s, any, "of the older pose");
  codec.object("aim", guidance.aim, "mean of the last samples",
               [](auto& inner, auto& aim) { describe_aim(inner, aim); });
  std::optional<double> moved_mm, moved_deg;
  if (guidance.bone_moved)
    moved_mm = guidance.bone_moved->distance_mm, moved_deg = guidance.bone_moved->turn_deg;
  codec.number("bone_moved_mm", moved_mm, any, "motion of the bone since guidance began");
  codec.number("bone_moved_deg", moved_deg, any, "likewise");
  if constexpr (!std::is_const_v<Value>)
    if (moved_mm && moved_deg) guidance.bone_moved = Motion{*moved_mm, *moved_deg};
}

}  // namespace helicarm::operation
