// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/model_description.h"
#include "helicarm/pipeline/run_fields.h"

/// The keys of plan.json, once for reader, writer and schema (core/codec.h). The help texts are the tables in
/// docs/formats.md.
namespace helicarm::operation::description {

using geometry::describe_pose;
using geometry::written_pose;
using pipeline::description::describe_bone;

inline constexpr Range millimetres{-100000, 100000};
inline constexpr int most_port = 65535;
inline constexpr std::size_t most_tunnels = 20, most_facets = 16, most_keep_outs = 100;

/// A number of plan_fields.h, by its limits and help.
template <class Codec, class Number>
void describe_field(Codec& codec, const char* key, Number& value, bool required = true) {
  const Field<OperationPlan>& field = field_named<OperationPlan>(plan_fields, key);
  const char* help = field.help.data();  // of a literal
  if constexpr (std::is_integral_v<std::remove_const_t<Number>>)
    codec.integer(key, value, int(field.range.low), int(field.range.high), help);
  else if (required)
    codec.number(key, value, field.range, help);
  else
    codec.number_or_default(key, value, field.range, help);
}

/// Files are named after views and tunnels.
void check_file_name(const JsonReader& reader, const char* key, const std::string& name);
std::vector<std::string> views_from(JsonReader& reader);
/// "markers", or of helicarm-plan/1 a key for each bone of the knee.
void read_markers(JsonReader& reader, const std::vector<guidance::Bone>& bones, TrackerPlan& tracker);
Json json_of_markers(const TrackerPlan& tracker);
void read_definitions(JsonReader& reader, TrackerPlan& tracker);
std::optional<Json> json_of_definitions(const TrackerPlan& tracker);
/// The keys that exclude each other or need each other.
void check_plan(const JsonReader& reader, const OperationPlan& plan);
void check_drill(const JsonReader& reader, const HandDrill& drill);
/// The bone with which its model moves, and the names of its line's ends.
void complete(const JsonReader& reader, OperationTunnel& tunnel, const OperationPlan& plan);

template <class Codec, class Tracker>
void describe_tracker(Codec& codec, Tracker& tracker, const std::vector<guidance::Bone>& bones) {
  codec.text("address", tracker.address,
             "numeric address of the OpenIGTLink server; `ndi:` and that of an [NDI "
             "tracker](devices.md#ndi-trackers-directly); or, with a `drill` only, `file:PATH`: a [sequence "
             "file](devices.md#sequence-files) (relative to the working directory) is played repeatedly, for "
             "tests without a tracker",
             {1, 200});
  codec.integer("port", tracker.port, 1, most_port, "of the server; of NDI trackers 8765");
  codec.custom(
      "definitions", false, {{"type", "object"}},
      "`{\"MARKER\": \"FILE.rom\", ...}`: definitions of the passive tools of an NDI tracker by the names of "
      "the "
      "markers, loaded at each connection; at most 24, relative to the plan's folder",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Tracker>) read_definitions(reader, tracker);
      },
      [&] { return json_of_definitions(tracker); });
  codec.number_or_default("rate_hz", tracker.rate_hz, {1, 1000}, "rate requested from the tracker");
  codec.custom(
      "markers", false, {{"type", "object"}},
      "`{\"L4\": \"name\", ..., \"tool\": \"name\"}`: the names of the bones' and the tool's markers in the "
      "tracker's messages; no name is also that of another body, a facet or the pointer; of `/1` the keys "
      "`femur`, `tibia` and `tool` beside this one",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Tracker>) read_markers(reader, bones, tracker);
      },
      [&] { return std::optional(json_of_markers(tracker)); });
  std::set<std::string> names;
  codec.list(
      "facets", tracker.facets, true, most_facets,
      "the markers of the calibrator; one visible marker is enough. Their largest deviation is added in "
      "quadrature to `sigma_mm` and `sigma_deg`",
      [&](auto& entry, auto& facet) {
        entry.text("name", facet.name, "of the marker");
        describe_pose(entry, "calibrator_from_facet", facet.calibrator_from_facet, written_pose, "mm");
        entry.number_or_default("sigma_mm", facet.sigma_mm, {0, 10},
                                "standard deviation per axis ([calibrate-mount](#mountjson) writes it)");
        entry.number_or_default("sigma_deg", facet.sigma_deg, {0, 10}, "likewise");
        entry.check([&](JsonReader& reader) { pipeline::description::take_name(reader, names, facet.name); });
      });
  codec.object("pointer", tracker.pointer, "calibrated (`tracker pivot`)", [](auto& inner, auto& pointer) {
    inner.text("name", pointer.name, "of its marker");
    inner.vector("tip_in_pointer", pointer.tip_in_pointer, millimetres, "mm");
  });
  describe_field(codec, "sigma_mm", tracker.sigma_mm);
  describe_field(codec, "sigma_deg", tracker.sigma_deg);
}

template <class Codec, class Approach>
void describe_approach(Codec& codec, Approach& approach) {
  describe_field(codec, "stand_off_mm", approach.stand_off_mm);
  describe_field(codec, "gap_mm", approach.gap_mm);
  describe_field(codec, "travel_mm_s", approach.travel_mm_s);
  describe_field(codec, "approach_mm_s", approach.approach_mm_s);
  describe_field(codec, "corrections", approach.corrections.most);
  describe_field(codec, "tolerance_mm", approach.corrections.tolerance_mm);
  describe_field(codec, "tolerance_deg", approach.corrections.tolerance_deg);
  codec.list("keep_outs", approach.keep_outs, false, most_keep_outs,
             "planes that arm and tool stay in front of: `point_in_base`, `normal`",
             [](auto& inner, auto& plane) { robot::describe_keep_out(inner, plane, millimetres); });
}

template <class Codec, class Robot>
void describe_robot(Codec& codec, Robot& robot) {
  codec.text("model", robot.model, "`UR5` or `UR5e`");
  codec.text("address", robot.address, "numeric");
  codec.integer("rtde_port", robot.rtde_port, 1, most_port, "of its real-time data");
  codec.integer("dashboard_port", robot.dashboard_port, 1, most_port, "of its dashboard");
  codec.integer("script_port", robot.script_port, 1, most_port, "of its programs");
  describe_pose(codec, "flange_from_tcp", robot.tool.flange_from_tcp, written_pose,
                "pose of the tool, with its origin at the tip and z pointing out of it, mm");
  codec.number("payload_kg", robot.tool.payload_kg, {0, robot::RobotLimits{}.heaviest_kg}, "its mass");
  codec.required_object("approach", robot.approach, "to a tunnel",
                        [](auto& inner, auto& approach) { describe_approach(inner, approach); });
}

template <class Codec, class Drill>
void describe_drill(Codec& codec, Drill& drill) {
  codec.vector("tip_in_tool", drill.tip_in_tool, millimetres,
               "point of its axis in the frame of the tool's marker");
  codec.vector("back_in_tool", drill.back_in_tool, millimetres, "another, at least 20 mm behind it");
  codec.number_or_default("sigma_mm", drill.sigma_mm, {0.001, 10}, "of each point per axis");
  codec.number_or_default("tolerance_mm", drill.tolerance_mm, {0.1, 10},
                          "of the tip's distance from the tunnel's axis, and of its depth beyond the end");
  codec.number_or_default("tolerance_deg", drill.tolerance_deg, {0.1, 45},
                          "of the angle between drill and axis");
  codec.check([&](JsonReader& reader) { check_drill(reader, drill); });
}

/// A tunnel between picks, or with "model" a line of that model's plan.
template <class Codec, class Tunnel, class Plan>
void describe_tunnel(Codec& codec, Tunnel& tunnel, Plan& plan) {
  const bool is_line = tunnel.of_model.has_value();
  codec.text("name", tunnel.name, "unique");
  codec.check([&](JsonReader& reader) { check_file_name(reader, "name", tunnel.name); });
  codec.form("model", false, !is_line, [&] {
    describe_bone(codec, "bone", true, tunnel.bone, plan.bones,
                  "one of `bones`; of a line the model's `moves_with`, or gives it");
    codec.text("start", tunnel.start, "name of a pick", {1, 200});
    codec.text("end", tunnel.end, "name of a pick", {1, 200});
    codec.choice("enter_at", tunnel.enter_at, pipeline::tunnel_end_words, "where the drill enters");
  });
  codec.form("model", true, is_line, [&] {
    if constexpr (std::is_const_v<Tunnel>) {
      describe_bone(codec, "bone", true, tunnel.bone, plan.bones, "");
      std::vector<pipeline::CaseModel> models;
      pipeline::description::describe_model_line(codec, *tunnel.of_model, models, plan.bones);
    } else {
      pipeline::ModelLine& line = tunnel.of_model.emplace();
      line.name = tunnel.name;
      pipeline::description::describe_model_line(codec, line, plan.models, plan.bones);
      codec.check([&](JsonReader& reader) { complete(reader, tunnel, plan); });
    }
  });
}

template <class Codec, class Plan>
void describe_lists(Codec& codec, Plan& plan, const std::string& origin) {
  using pipeline::description::take_name;
  std::set<std::string> tunnels, checks;
  if (codec.wants(!plan.models.empty()))
    pipeline::description::describe_models(codec, plan.models, false, plan.folder, plan.bones);
  codec.list(
      "tunnels", plan.tunnels, true, most_tunnels,
      "between picks; or with `model` instead of `start` and `end`, as in [case.json](#casejson): a line "
      "of a model's plan, which is [registered in the operation](devices.md#plans-of-a-ct)",
      [&](auto& entry, auto& tunnel) {
        describe_tunnel(entry, tunnel, plan);
        entry.check([&](JsonReader& reader) { take_name(reader, tunnels, tunnel.name); });
      });
  codec.list(
      "check_points", plan.check_points, false, most_tunnels,
      "points to be touched before the first image, and after the last one before each order to that bone; "
      "they need "
      "`tracker.pointer`",
      [&](auto& entry, auto& check) {
        entry.text("name", check.name, "unique");
        describe_bone(entry, "bone", true, check.bone, plan.bones, "one of `bones`");
        entry.number_or_default("limit_mm", check.limit_mm, {0.1, 10}, "of its motion in the bone's frame");
        entry.check([&](JsonReader& reader) { take_name(reader, checks, check.name); });
      });
  codec.custom(
      "picks", false, {{"type", "array"}},
      "as in [case.json](#casejson); they may be given later with `navigate --picks`",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Plan>)
          if (const Json& picks = reader.raw("picks"); !picks.is_null())
            plan.picks = value_or_throw(picks_of(plan, picks, origin));
      },
      [&] {
        Json picks = Json::array();
        for (const pipeline::Pick& pick : plan.picks) picks.push_back(pipeline::to_json(pick));
        return std::optional(std::move(picks));
      });
}

template <class Codec, class Plan>
void describe_options(Codec& codec, Plan& plan, const std::string& origin) {
  describe_field(codec, "max_error_mm", plan.max_error_mm, false);
  codec.choice("method", plan.measuring.run.method, rectification::method_words,
               "of rectification, as the option of `run`; `navigate --method` overrides it");
  describe_field(codec, "motion_sigma_mm", plan.measuring.run.motion_sigma_mm, false);
  describe_field(codec, "search_mm", plan.measuring.search.shift_mm, false);
  describe_field(codec, "search_deg", plan.measuring.search.turn_deg, false);
  codec.custom(
      "machine", false, {{"type", "object"}},
      "the content of a C-arm's history, used as prior; `navigate --machine FILE` puts it there, and the "
      "session's record holds it",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Plan>)
          if (const Json& history = reader.raw("machine"); !history.is_null())
            plan.measuring.run.history =
                value_or_throw(calibration::history_from_json(history, origin + ": machine"));
      },
      [&] {
        const auto& history = plan.measuring.run.history;
        return history ? std::optional(calibration::to_json(*history)) : std::nullopt;
      });
  describe_field(codec, "plan_stale_mm", plan.limits.distance_mm, false);
  describe_field(codec, "plan_stale_deg", plan.limits.turn_deg, false);
  describe_field(codec, "plan_stale_s", plan.limits.age_s, false);
}

template <class Codec, class Plan>
void describe_plan(Codec& codec, Plan& plan, const std::string& origin) {
  constexpr bool reads = !std::is_const_v<Plan>;
  codec.custom(
      "format", true, {{"enum", {"helicarm-plan/2", "helicarm-plan/1"}}},
      "`\"helicarm-plan/2\"`; `/1`, which names the markers in `tracker.femur`, `tibia` and `tool`, is read "
      "too",
      [](JsonReader& reader) {
        reader.choice("format", {"helicarm-plan/2", "helicarm-plan/1"});
      },
      [] { return std::optional<Json>("helicarm-plan/2"); });
  codec.text("calibrator", plan.calibrator,
             "name of a built-in, or a file by its path from the plan's folder", {1, 200});
  codec.text("plate", plan.plate, "likewise; `null` or absent: flat panel", {1, 200});
  codec.custom(
      "views", true, {{"type", "array"}, {"items", {{"type", "string"}}}, {"minItems", 2}, {"maxItems", 50}},
      "names in the order of the acquisitions",
      [&](JsonReader& reader) {
        if constexpr (reads) plan.views = views_from(reader);
      },
      [&] { return std::optional<Json>(plan.views); });
  codec.custom(
      "bones", false, {{"type", "array"}, {"items", {{"type", "string"}}}},
      "names of the bones, as in [case.json](#casejson). Default `[\"femur\", \"tibia\"]`",
      [&](JsonReader& reader) {
        if constexpr (reads) plan.bones = pipeline::bones_from(reader);
      },
      [&] { return std::optional<Json>(plan.bones); });
  codec.required_object("tracker", plan.tracker, "its server and its names for the markers",
                        [&](auto& inner, auto& tracker) { describe_tracker(inner, tracker, plan.bones); });
  codec.object(
      "drill", plan.drill,
      "a [drill in a person's hand](devices.md#a-drill-held-by-hand) instead of a robot: two points of "
      "its axis in the frame of the tool's marker",
      [](auto& inner, auto& drill) { describe_drill(inner, drill); });
  codec.form("drill", false, !plan.drill, [&] {
    codec.required_object("robot", plan.robot, "`null` or absent if `drill` is given",
                          [](auto& inner, auto& robot) { describe_robot(inner, robot); });
  });
  codec.check([&](JsonReader& reader) {
    if (plan.drill && !reader.raw("robot").is_null())
      reader.refuse(Reason::bad_value, "robot", "must be null if \"drill\" is given");
  });
  describe_lists(codec, plan, origin);
  describe_options(codec, plan, origin);
  codec.check([&](JsonReader& reader) { check_plan(reader, plan); });
}

}  // namespace helicarm::operation::description
