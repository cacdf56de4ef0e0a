// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include <fmt/format.h>

#include "helicarm/core/codec.h"
#include "helicarm/geometry/pose_codec.h"
#include "helicarm/operation/guidance_description.h"
#include "helicarm/operation/session_records.h"
#include "helicarm/pipeline/poses_json.h"

/// The keys of each record of session.log, once for reader, writer and schema (core/codec.h).
namespace helicarm::operation::record::description {

using geometry::describe_pose;
using geometry::recorded_pose;

inline constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};
inline constexpr TextLimits name_limits{0, 1000}, message_limits{0, 100000};
inline constexpr int most_replanned = 1'000'000;
inline constexpr std::size_t most_starts = 100;  // one for each model
inline constexpr std::array<std::string_view, 6> look_words{"plan",   "hand-eye", "correct",
                                                            "verify", "withdraw", "guide"};

inline constexpr std::array<std::string_view, 7> guidance_end_words{
    "verified", "person", "plan_stale", "new_guidance", "new_plan", "operation", "check_point"};

template <class Codec, class Text>
void describe_name(Codec& codec, const char* key, Text& name, const char* help) {
  codec.text(key, name, help, name_limits);
}

template <class Codec, class Window>
void describe_window(Codec& codec, Window& window) {
  codec.custom(
      "window", true, {{"type", "object"}}, "the tracker's samples",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Window>)
          window = value_or_throw(pose_window_from(reader.raw("window"), reader.where()));
      },
      [&] { return std::optional(to_json(window)); });
}

/// Texts or numbers by name.
template <class Codec, class Values>
void describe_named(Codec& codec, const char* key, bool required, Values& values, const char* help) {
  codec.custom(
      key, required, {{"type", "object"}}, help,
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Values>) {
          if (!required && !reader.has(key)) return void(reader.raw(key));
          const Json& object = reader.raw(key);
          JsonReader inner = reader.object(key);
          for (const auto& [name, value] : object.items())
            if constexpr (std::is_same_v<typename Values::mapped_type, double>)
              values[name] = inner.number(name.c_str(), any);
            else
              values[name] = inner.text(name.c_str());
        }
      },
      [&] { return std::optional<Json>(values); });
}

template <class Codec>
void describe_files(Codec& codec, auto& files) {
  describe_named(codec, "files", true, files, "digests of the files written");
}

/// A figure that follows from the others.
template <class Codec>
void describe_derived(Codec& codec, const char* key, double value, const char* help) {
  constexpr double rounding = 1e-12;
  codec.custom(
      key, true, {{"type", "number"}}, help,
      [&](JsonReader& reader) {
        if (std::abs(reader.number(key, any) - value) > rounding * std::max(1.0, std::abs(value)))
          reader.refuse(Reason::bad_value, key,
                        fmt::format("is not {:.6g}, as the other figures say", value));
      },
      [&] { return std::optional<Json>(value); });
}

template <class Codec, class Miss>
void describe_end(Codec& codec, Miss& miss) {
  codec.vector("across_mm", miss.across_mm, any, "along x and y of the tool");
  codec.matrix("covariance_mm2", miss.covariance, any,
               "of X-ray measurement, tracker and hand-eye calibration");
  describe_derived(codec, "distance_mm", miss.distance_mm(), "of the tunnel's end from the tool's axis");
  describe_derived(codec, "predicted_mm", miss.predicted_mm(), "root mean square of the true distance");
}

template <class Codec, class Found>
void describe_hand_eye(Codec& codec, Found& found) {
  describe_pose(codec, "flange_from_marker", found.flange_from_marker, recorded_pose, "mm");
  describe_pose(codec, "tracker_from_base", found.tracker_from_base, recorded_pose, "mm");
  codec.matrix("covariance", found.covariance, any, "of both: mm and rad");
  codec.number("rms_mm", found.rms_mm, any, "of the marker's position");
  codec.number("rms_deg", found.rms_deg, any, "of its rotation");
}

/// Of this version, or by bone of an earlier one.
guidance::Poses recorded_poses(const Json& recorded, const std::string& where);
/// A case of an earlier version does not say what it is, but has tool lines if it is a verification.
std::string verified_by(const Json& case_json);

template <class Kind>
using Of = std::type_identity<Kind>;

template <class Codec, class Value>
void describe(Codec& codec, Value& session, Of<record::Session>) {
  describe_name(codec, "format", session.format, "`helicarm-session/1`");
  describe_name(codec, "version", session.version, "of helicarm");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& models, Of<record::Models>) {
  describe_name(codec, "folder", models.folder, "of the models' files");
  describe_files(codec, models.files);
}

template <class Codec, class Value>
void describe(Codec& codec, Value& exposure, Of<record::Exposure>) {
  describe_name(codec, "view", exposure.view, "of the image");
  describe_name(codec, "picture", exposure.picture, "digest of the image");
  describe_name(codec, "inbox", exposure.inbox, "its folder in the session");
  codec.number("held_s", exposure.held_s, any, "its delay beyond that of the fastest image");
  describe_window(codec, exposure.window);
  codec.custom(
      "poses", false, {{"type", "object"}}, "computed from the samples; nothing where they were refused",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Value>)
          if (const Json& poses = reader.raw("poses"); !poses.is_null())
            exposure.poses = recorded_poses(poses, reader.where());
      },
      [&] { return exposure.poses ? std::optional(pipeline::to_json(*exposure.poses)) : std::nullopt; });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& refused, Of<record::Refused>) {
  describe_name(codec, "view", refused.view, "of the image");
  describe_name(codec, "picture", refused.picture,
                "digest of the image; nothing: an earlier one, found delayed");
  describe_name(codec, "why", refused.why, "code of the reason");
  describe_named(codec, "figures", false, refused.figures, "behind it");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& touched, Of<record::Touched>) {
  describe_name(codec, "check_point", touched.check_point, "its name");
  describe_window(codec, touched.window);
  codec.vector("in_bone", touched.in_bone, any, "position in the frame of the bone's marker, mm");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& begun, Of<record::CaseBegun>) {
  describe_name(codec, "folder", begun.folder, "of the case");
  codec.custom(
      "case", true, {{"type", "object"}}, "its case.json",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Value>) {
          begun.case_json = reader.raw("case");
          if (!begun.case_json.is_object()) reader.refuse(Reason::bad_value, "case", "is missing");
        }
      },
      [&] { return std::optional(begun.case_json); });
  describe_files(codec, begun.files);
  codec.custom(
      "verifies", false, {{"type", "string"}}, "the tunnel whose verification it is; `null`: a measurement",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Value>) {
          const Json& tunnel = reader.raw("verifies");
          begun.verifies = tunnel.is_string() ? tunnel.get<std::string>() : verified_by(begun.case_json);
        }
      },
      [&] { return std::optional(begun.verifies.empty() ? Json() : Json(begun.verifies)); });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& measured, Of<record::Measured>) {
  describe_name(codec, "folder", measured.folder, "of the case");
  describe_name(codec, "digest", measured.digest, "of the result without its timing");
  describe_files(codec, measured.files);
}

template <class Codec, class Value>
void describe(Codec& codec, Value& registered, Of<record::Registered>) {
  describe_name(codec, "folder", registered.folder, "of its files");
  describe_name(codec, "digest", registered.digest, "of the registration without its timing");
  describe_files(codec, registered.files);
  if (codec.wants(!registered.starts.empty()))
    codec.list("starts", registered.starts, false, most_starts,
               "of models that a person moved: where the search began, instead of the plan's start",
               [](auto& inner, auto& start) {
                 describe_name(inner, "model", start.model, "its name");
                 describe_pose(inner, "world_from_model", start.world_from_model, recorded_pose, "mm");
               });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& confirmed, Of<record::RegistrationConfirmed>) {
  describe_name(codec, "digest", confirmed.digest, "of the registration");
  describe_name(codec, "by", confirmed.by, "name of the person");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& poses, Of<record::Poses>) {
  codec.required_choice("why", poses.why, look_words, "for what the tracker was looked at");
  describe_window(codec, poses.window);
}

template <class Codec, class Value>
void describe(Codec& codec, Value& tour, Of<record::Tour>) {
  describe_pose(codec, "base_from_tcp", tour.base_from_tcp, recorded_pose, "of the robot, mm");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& hand_eye, Of<record::HandEye>) {
  codec.list("pairs", hand_eye.pairs, true, 1000, "of poses", [](auto& inner, auto& pair) {
    describe_pose(inner, "base_from_flange", pair.base_from_flange, recorded_pose, "mm");
    describe_pose(inner, "tracker_from_marker", pair.tracker_from_marker, recorded_pose, "mm");
  });
  codec.required_object("found", hand_eye.found, "the estimate",
                        [](auto& inner, auto& found) { describe_hand_eye(inner, found); });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& withdraw, Of<record::Withdraw>) {
  describe_name(codec, "digest", withdraw.digest, "of the order that the tool leaves");
  describe_pose(codec, "base_from_tcp", withdraw.from.base_from_tcp, recorded_pose, "its pose, mm");
  describe_pose(codec, "base_from_rest", withdraw.from.base_from_rest, recorded_pose,
                "the pose to return to");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& robot, Of<record::Robot>) {
  codec.vector("joints_rad", robot.joints, {-100, 100}, "of the robot before the order that follows");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& preview, Of<record::Preview>) {
  describe_name(codec, "order", preview.order, "its name");
  describe_files(codec, preview.files);
}

template <class Codec, class Value>
void describe(Codec& codec, Value& confirmed, Of<record::Confirmed>) {
  describe_name(codec, "order", confirmed.order, "its name");
  describe_name(codec, "digest", confirmed.digest, "of its text");
  describe_name(codec, "by", confirmed.by, "name of the person who confirmed it");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& carried_out, Of<record::CarriedOut>) {
  describe(codec, carried_out.confirmed, Of<record::Confirmed>{});
}

template <class Codec, class Value>
void describe(Codec& codec, Value& halted, Of<record::Halted>) {
  describe_name(codec, "order", halted.order, "that was refused or did not complete");
  describe_name(codec, "why", halted.why, "code of the reason");
  codec.text("message", halted.message, "its sentence", message_limits);
  describe_named(codec, "figures", false, halted.figures, "behind it");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& replanned, Of<record::Replanned>) {
  describe_name(codec, "order", replanned.order, "that is planned again after a stop");
  codec.integer("number", replanned.number, 0, most_replanned, "how often so far");
  describe_name(codec, "why", replanned.why, "code of the stop's reason");
  describe_name(codec, "by", replanned.by, "name of the person who agreed");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& navigated, Of<record::Navigated>) {
  describe_name(codec, "tunnel", navigated.tunnel, "its name");
  codec.list("loop", navigated.loop, true, 1000, "errors at each step of the closed loop",
             [](auto& inner, auto& miss) {
               inner.number("distance_mm", miss.distance_mm, any, "of the tip");
               inner.number("turn_deg", miss.turn_deg, any, "of the tool");
               inner.number("sigma_mm", miss.sigma_mm, any, "of the position");
             });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& guide, Of<record::Guide>) {
  describe_name(codec, "tunnel", guide.tunnel, "to which a hand-held drill is guided from now on");
  codec.number("oldest_pose_s", guide.oldest_pose_s, any, "the greatest age of a pose");
  describe_window(codec, guide.window);
}

template <class Codec, class Value>
void describe(Codec& codec, Value& guided, Of<record::Guided>) {
  describe_name(codec, "tunnel", guided.tunnel, "its name");
  describe_window(codec, guided.window);
  codec.required_object("guidance", guided.guidance,
                        "the decision, as [printed by `navigate --json`](#lines-of-navigate---json)",
                        [](auto& inner, auto& guidance) { describe_guidance(inner, guidance); });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& ended, Of<record::GuidanceEnded>) {
  describe_name(codec, "tunnel", ended.tunnel, "its name");
  codec.required_choice(
      "by", ended.by, guidance_end_words,
      "`verified`; `person`; `plan_stale`: it began again after that decision; "
      "`new_guidance`: another began; `new_plan`: images, measurement or registration are "
      "others now; `operation`: the operation ended; `check_point`: one of its bone was refused");
}

template <class Codec, class Value>
void describe(Codec& codec, Value& outcome, Of<record::Outcome>) {
  const auto end = [](auto& inner, auto& miss) { describe_end(inner, miss); };
  describe_name(codec, "tunnel", outcome.tunnel, "its name");
  codec.required_object("start", outcome.start, "distance of the tunnel's start from the tool's axis", end);
  codec.required_object("end", outcome.end, "likewise", end);
  codec.object("depth", outcome.depth, "of a hand-held drill's tip; sessions of earlier versions lack it",
               [](auto& inner, auto& depth) {
                 inner.number("beyond_end_mm", depth.beyond_end_mm, any,
                              "beyond the planned end along the tunnel, negative before it");
                 inner.number("sigma_mm", depth.sigma_mm, any, "standard deviation");
                 inner.number("tolerance_mm", depth.tolerance_mm, any, "of the plan");
                 describe_derived(inner, "error_95_mm", depth.error_95_mm(), "of `beyond_end_mm`");
               });
}

template <class Codec, class Value>
void describe(Codec& codec, Value& end, Of<record::End>) {
  describe_name(codec, "why", end.why, "code of the failure that ended it, if one did");
  codec.text("message", end.message, "its sentence", message_limits);
}

}  // namespace helicarm::operation::record::description
