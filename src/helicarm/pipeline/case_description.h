// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/case_view_description.h"
#include "helicarm/pipeline/model_description.h"

/// The keys of case.json, once for reader, writer and schema (core/codec.h). The help texts are the table in
/// docs/formats.md.
namespace helicarm::pipeline::description {

inline constexpr std::size_t most_views = 50;
inline constexpr std::size_t most_picks = 1000;
inline constexpr std::size_t most_bodies = 50, most_markers = 200;
inline constexpr Range pixel_range{-0.5, 65535};
inline constexpr Range place_range{-10000, 10000};
inline constexpr std::array<std::string_view, 2> snap_words{"none", "ball"};
inline constexpr std::array<std::string_view, 2> samples_words{"shared", "independent"};

template <class Codec, class Label>
void describe_bone_label(Codec& codec, Label& label) {
  codec.text("name", label.name, "free");
  codec.choice("side", label.side, side_words, "of the patient");
}

template <class Codec, class PickValue>
void describe_pick(Codec& codec, PickValue& pick, const std::vector<CaseView>& views,
                   const std::vector<guidance::Bone>& bones, Purpose purpose) {
  codec.text("name", pick.name, "one pick per name and view; not the name of a target");
  codec.text("view", pick.view, "name of a view");
  codec.check([&](JsonReader& reader) {
    if (!find_named(views, pick.view, &CaseView::name))
      reader.refuse(Reason::bad_value, "view", fmt::format("\"{}\" is not a view of the case", pick.view));
  });
  check_track(codec, "frame", purpose);
  codec.integer("frame", pick.frame, 0, most_number,
                "of `helicarm track`: the sequence's first frame, or a later one that it corrects");
  codec.vector("uv", pick.uv_raw, pixel_range, "raw pixel `[u, v]`, inside the image");
  if (codec.wants(pick.snap != Snap::none))
    codec.choice(
        "snap", pick.snap, snap_words,
        "`\"ball\"`: refine to the image of the centre of the ball near `uv`; `\"none\"`: use `uv` as it is");
  if (codec.wants(pick.snap == Snap::ball))
    codec.number_or_default("diameter_mm", pick.diameter_mm, {0.5, 30}, "of that ball");
  codec.number("sigma_px", pick.sigma_px, {0, 100},
               "per axis; 0 means exact. Default 0.5, for a ball the sigma of its fit");
  codec.custom(
      "moves_with", false, {{"type", "string"}},
      "one of the case's `bones`, the same in all views: the rays are intersected in that bone's frame",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<PickValue>)
          if (!reader.raw("moves_with").is_null()) pick.moves_with = bone_from(reader, "moves_with", bones);
      },
      [&] { return pick.moves_with ? std::optional(Json(*pick.moves_with)) : std::nullopt; });
  codec.object("bone", pick.bone, "what the point lies on, for display",
               [](auto& inner, auto& label) { describe_bone_label(inner, label); });
}

template <class Codec, class Line>
void describe_tool_line(Codec& codec, Line& line) {
  codec.text("name", line.name, "unique");
  codec.text("tunnel", line.tunnel, "name of a tunnel");
  codec.vector("p1_in_calibrator", line.p1_in_calibrator, place_range,
               "point on the instrument's axis; of one that was measured beside a bone, where it was at the "
               "first view's acquisition");
  codec.vector("p2_in_calibrator", line.p2_in_calibrator, place_range, "another, at least 1 mm apart");
}

template <class Codec, class Noise>
void describe_tracker(Codec& codec, Noise& noise) {
  codec.number("sigma_mm", noise.sigma_mm, {0, 100}, "of each reading, per axis");
  codec.number("sigma_deg", noise.sigma_deg, {0, 90}, "likewise");
  codec.choice("samples", noise.samples, samples_words,
               "`\"shared\"` (one reading for all times) or `\"independent\"`");
}

template <class Codec, class Picks>
void describe_picks(Codec& codec, Picks& picks, const std::vector<CaseView>& views,
                    const std::vector<guidance::Bone>& bones,
                    const std::vector<phantom::CalibratorTarget>& targets, Purpose purpose) {
  std::set<std::tuple<std::string, std::string, std::optional<int>>> clicks;
  codec.list("picks", picks, false, most_picks,
             "image points in one view each; picks with the same name in several views are one point",
             [&](auto& entry, auto& pick) {
               describe_pick(entry, pick, views, bones, purpose);
               entry.check([&](JsonReader& reader) {
                 if (!clicks.emplace(pick.name, pick.view, pick.frame).second)
                   reader.refuse(Reason::name_clash, "name",
                                 fmt::format("\"{}\" is given twice in {}", pick.name, pick.view));
                 if (find_named(targets, pick.name, &phantom::CalibratorTarget::name))
                   reader.refuse(Reason::name_clash, "name",
                                 fmt::format("\"{}\" is a target of the calibrator", pick.name));
                 const Pick* other = find_named(picks, pick.name, &Pick::name);
                 if (other && other->moves_with != pick.moves_with)
                   reader.refuse(Reason::bad_value, "moves_with",
                                 fmt::format("of \"{}\" differs between views", pick.name));
               });
             });
}

template <class Codec, class CaseValue>
void describe_views(Codec& codec, CaseValue& the_case, Purpose purpose) {
  std::set<std::string> names;
  codec.list("views", the_case.views, true, purpose == Purpose::sweep ? most_frames : most_views,
             "at least one; one view is calibrated, points need two", [&](auto& entry, auto& view) {
               describe_view(entry, view, the_case.folder, the_case.bones, purpose);
               entry.check([&](JsonReader& reader) {
                 take_name(reader, names, view.name);
                 if (view.plate_image && !the_case.plate)
                   reader.refuse(Reason::bad_value, "plate_image", "is given, but the case has no plate");
               });
             });
  codec.check([&](JsonReader& reader) {
    if (the_case.views.empty())
      reader.refuse(Reason::bad_value, "views", "is empty: at least one view is required");
    const auto brings = [&](const CaseView& view) { return brings_camera(the_case, view); };
    if (std::ranges::any_of(the_case.views, brings) && !brings_cameras(the_case))
      reader.refuse(Reason::bad_value, "views",
                    purpose == Purpose::track
                        ? "\"camera\" or \"calibration\" must be given for all views or "
                          "for none: their world is one"
                        : "\"camera\" must be given for all views or for none: their "
                          "world is one");
  });
}

/// An element of "tunnels": from pick to pick, or a line of a model's plan.
struct AnyTunnel {
  std::string name, start, end;
  std::optional<ModelLine> line = {};
};
std::vector<AnyTunnel> all_tunnels(const Case& the_case);
void set_tunnels(Case& the_case, const std::vector<AnyTunnel>& tunnels);

template <class Codec, class Tunnel>
void describe_any_tunnel(Codec& codec, Tunnel& tunnel, const Case& the_case, std::vector<CaseModel>& models) {
  codec.text("name", tunnel.name, "unique");
  codec.form("model", false, !tunnel.line, [&] {
    codec.text("start", tunnel.start, "name of a pick");
    codec.text("end", tunnel.end, "name of a pick");
    codec.check([&](JsonReader& reader) {
      for (const auto& [key, pick] : {std::pair{"start", &tunnel.start}, {"end", &tunnel.end}})
        if (!find_named(the_case.picks, *pick, &Pick::name))
          reader.refuse(Reason::bad_value, key, fmt::format("\"{}\" is not a pick of the case", *pick));
    });
  });
  codec.form("model", true, tunnel.line.has_value(), [&] {
    if constexpr (std::is_const_v<Tunnel>) {
      describe_model_line(codec, *tunnel.line, models, the_case.bones);
    } else {
      tunnel.line.emplace().name = tunnel.name;
      describe_model_line(codec, *tunnel.line, models, the_case.bones);
    }
  });
}

template <class Codec, class CaseValue>
void describe_tunnels(Codec& codec, CaseValue& the_case) {
  std::set<std::string> names;
  std::vector<AnyTunnel> tunnels = all_tunnels(the_case);
  std::vector<CaseModel> models = the_case.models;
  codec.list("tunnels", tunnels, false, most_picks, "from pick to pick, or a line of a model's plan",
             [&](auto& entry, auto& tunnel) {
               describe_any_tunnel(entry, tunnel, the_case, models);
               entry.check([&](JsonReader& reader) { take_name(reader, names, tunnel.name); });
             });
  if constexpr (!std::is_const_v<CaseValue>) {
    set_tunnels(the_case, tunnels);
    the_case.models = std::move(models);  // a line may say with which bone its model moves
  }
}

template <class Codec, class CaseValue>
void describe_tool_lines(Codec& codec, CaseValue& the_case) {
  std::set<std::string> lines;
  codec.list("tool_lines", the_case.tool_lines, false, most_picks, "the instrument's axis as it was measured",
             [&](auto& entry, auto& line) {
               describe_tool_line(entry, line);
               entry.check([&](JsonReader& reader) {
                 take_name(reader, lines, line.name);
                 if (!find_named(the_case.tunnels, line.tunnel, &CaseTunnel::name))
                   reader.refuse(Reason::bad_value, "tunnel",
                                 fmt::format("\"{}\" is not a tunnel of the case", line.tunnel));
                 if ((line.p2_in_calibrator - line.p1_in_calibrator).norm() < 1)
                   reader.refuse(Reason::bad_value, "p2_in_calibrator",
                                 "is less than 1 mm from \"p1_in_calibrator\"");
               });
             });
}

/// The names of a body's markers.
std::vector<std::string> marker_names_from(JsonReader& reader);

template <class Codec, class Body>
void describe_body(Codec& codec, Body& body, const std::filesystem::path& folder) {
  codec.text("name", body.name, "unique; NAME.tra is written");
  codec.check([&](JsonReader& reader) {
    if (body.name.find_first_of("/\\") != std::string::npos || body.name.starts_with('.'))
      reader.refuse(Reason::bad_value, "name", "is no file name: NAME.tra is written");
  });
  codec.custom(
      "markers", true, {{"type", "array"}, {"items", {{"type", "string"}}}, {"maxItems", most_markers}},
      "names of picks, each in one body",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Body>) body.markers = marker_names_from(reader);
      },
      [&] { return std::optional<Json>(body.markers); });
  codec.file(
      "geometry", body.geometry, folder,
      "path of a CSV, `name,x_mm,y_mm,z_mm` of its markers in a frame of their own; absent: learnt from "
      "the sequence");
}

template <class Codec, class CaseValue>
void describe_sequence(Codec& codec, CaseValue& the_case, Purpose purpose) {
  check_track(codec, "markers", purpose);
  codec.object("markers", the_case.markers, "of [`helicarm track`](motion.md#run-it)",
               [](auto& inner, auto& markers) {
                 inner.number("diameter_mm", markers.diameter_mm, {0.1, 30}, "of the markers");
               });
  std::set<std::string> names;
  check_track(codec, "bodies", purpose);
  if (codec.wants(!the_case.bodies.empty()))
    codec.list("bodies", the_case.bodies, false, most_bodies, "of `helicarm track`: rigid sets of markers",
               [&](auto& entry, auto& body) {
                 describe_body(entry, body, the_case.folder);
                 entry.check([&](JsonReader& reader) { take_name(reader, names, body.name); });
               });
  check_track(codec, "frame_rate_hz", purpose);
  codec.number("frame_rate_hz", the_case.frame_rate_hz, {0.01, 1e5}, "of `helicarm track`");
  check_track(codec, "calibration", purpose);
  codec.file("calibration", the_case.calibration, the_case.folder,
             "of `helicarm track`: as `calibration` of every view");
}

/// Sets calibrator and plate, read from their files.
void read_calibrator(Case& read, JsonReader& reader);
void read_plate(Case& read, JsonReader& reader);
/// A calibrator may be missing beside cameras, and for a phantom of balls whose diameters are known.
void check_calibrator(const Case& read, JsonReader& reader, Purpose purpose);

template <class Codec, class CaseValue>
void describe_case(Codec& codec, CaseValue& the_case, Purpose purpose) {
  constexpr bool reads = !std::is_const_v<CaseValue>;
  const auto named = [](const auto& name) { return name.empty() ? Json() : Json(name); };
  codec.custom(
      "format", true, {{"enum", {"helicarm-case/2", "helicarm-case/1"}}},
      "`\"helicarm-case/2\"`; `/1`, with poses in `tracker_from_femur` and `tracker_from_tibia`, is read too",
      [](JsonReader& reader) {
        reader.choice("format", {"helicarm-case/2", "helicarm-case/1"});
      },
      [] { return std::optional<Json>("helicarm-case/2"); });
  describe_sequence(codec, the_case, purpose);
  codec.custom(
      "calibrator", true, {{"type", {"string", "null"}}},
      "`\"udcsc\"` or path of a [calibrator.json](#calibratorjson); may be `null` for `phantom measure "
      "--from-scratch`",
      [&](JsonReader& reader) {
        if constexpr (reads) read_calibrator(the_case, reader);
      },
      [&] { return std::optional(named(the_case.calibrator_name)); });
  codec.custom(
      "plate", false, {{"type", "string"}},
      "`\"plate48\"` or path of a [plate.json](#platejson); `null` or absent: flat panel",
      [&](JsonReader& reader) {
        if constexpr (reads) read_plate(the_case, reader);
      },
      [&] { return std::optional(the_case.plate_name ? Json(*the_case.plate_name) : Json()); });
  codec.custom(
      "bones", false, {{"type", "array"}, {"items", {{"type", "string"}}}, {"maxItems", most_bones}},
      "names of the bones that carry markers, each 1 to 100 characters, none of them that of another frame "
      "(`tool`, "
      "`calibrator`, ...). Default `[\"femur\", \"tibia\"]`",
      [&](JsonReader& reader) {
        if constexpr (reads) the_case.bones = bones_from(reader);
      },
      [&] { return std::optional(Json(the_case.bones)); });
  describe_views(codec, the_case, purpose);
  codec.check([&](JsonReader& reader) {
    if constexpr (reads) check_calibrator(the_case, reader, purpose);
  });
  describe_poses(
      codec, "poses_now", the_case.poses_now, the_case.bones, OtherMarker::tool,
      "current poses: `tracker_from_bone` (`{\"L4\": pose, ...}`, those of the case's bones that are seen), "
      "`tracker_from_tool`");
  if (codec.wants(the_case.tracker.sigma_mm > 0 || the_case.tracker.sigma_deg > 0))
    codec.object("tracker", the_case.tracker, "noise of the tracker's readings",
                 [](auto& inner, auto& noise) { describe_tracker(inner, noise); });
  describe_picks(codec, the_case.picks, the_case.views, the_case.bones, the_case.calibrator.targets, purpose);
  if (codec.wants(!the_case.models.empty()))
    describe_models(codec, the_case.models, purpose == Purpose::registration, the_case.folder,
                    the_case.bones);
  codec.check([&](JsonReader& reader) {
    if (purpose == Purpose::registration && the_case.models.empty())
      reader.refuse(Reason::bad_value, "models", "is empty: name a volume or a surface");
  });
  describe_tunnels(codec, the_case);
  describe_tool_lines(codec, the_case);
  codec.numbers("diameters_mm", the_case.diameters_mm, 10, {0.5, 30},
                "of the balls; required for `phantom measure --from-scratch`, also beside a `calibrator`");
  if (codec.wants(!the_case.notes.empty()))
    codec.text_or_default("notes", the_case.notes, "ignored", {0, 100000});
}

}  // namespace helicarm::pipeline::description
