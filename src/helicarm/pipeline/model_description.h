// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <set>

#include "helicarm/core/codec.h"
#include "helicarm/geometry/pose_codec.h"
#include "helicarm/pipeline/case_model.h"
#include "helicarm/pipeline/poses_json.h"

/// Models, and the lines of their plans as tunnels, in case.json and plan.json.
namespace helicarm::pipeline::description {

inline constexpr std::array<std::string_view, 2> side_words{"left", "right"};

template <class T, class Name>
const T* find_named(const std::vector<T>& all, const std::string& name, Name name_of) {
  const auto found = std::ranges::find(all, name, name_of);
  return found == all.end() ? nullptr : &*found;
}

inline void take_name(const JsonReader& reader, std::set<std::string>& names, const std::string& name) {
  if (!names.insert(name).second)
    reader.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", name));
}

inline constexpr std::size_t most_models = 20;
inline constexpr Range hu_range{-32768, 32767};
inline constexpr int volume_label_limit = 65535;

/// One of `bones`. An unset name is not written.
template <class Codec, class Name>
void describe_bone(Codec& codec, const char* key, bool required, Name& bone,
                   const std::vector<guidance::Bone>& bones, const char* help) {
  codec.custom(
      key, required, {{"type", "string"}}, help,
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Name>)
          if (required || !reader.raw(key).is_null()) bone = bone_from(reader, key, bones);
      },
      [&]() -> std::optional<Json> {
        if constexpr (requires { bone.has_value(); })
          return bone ? std::optional<Json>(*bone) : std::nullopt;
        else
          return bone;
      });
}

template <class Codec, class Model>
void describe_start(Codec& codec, Model& model, const std::filesystem::path& folder) {
  geometry::describe_pose(codec, "world_from_model", model.world_from_model, geometry::written_pose,
                          "where the registration begins, mm");
  codec.file(
      "landmarks", model.landmarks, folder,
      "path of a CSV of points, `name,x_mm,y_mm,z_mm` in the model, or of 3D Slicer's markups: three or more "
      "that are picks in two views");
  codec.check([&](JsonReader& reader) {
    if (model.world_from_model && model.landmarks)
      reader.refuse(Reason::bad_value, "landmarks", "cannot be combined with \"world_from_model\"");
  });
}

/// A mask's keys: `key`, `key`_label, ... `file` describes the first, `what` is its body.
template <class Codec, class Mask>
void describe_mask(Codec& codec, const std::string& key, Mask& mask, const std::filesystem::path& folder,
                   const char* file, const std::string& what) {
  const std::string label = key + "_label", segment = key + "_segment", threshold = key + "_threshold";
  codec.file(key.c_str(), mask.file, folder, file);
  codec.integer(label.c_str(), mask.label, 1, volume_label_limit,
                ("label of " + what +
                 " where the file is a label map, or the segment's number in a DICOM segmentation; with "
                 "several of them it must be given")
                    .c_str());
  codec.text(segment.c_str(), mask.segment,
             "the same by the segment's label in a DICOM segmentation, such as `\"Femur\"`");
  codec.number(
      threshold.c_str(), mask.threshold, {0.01, 1},
      ("share from which a voxel of a fractional DICOM segmentation, or of a mask that holds shares, is of " +
       what + ". It must be given of such a one, and only of it")
          .c_str());
  codec.check([&](JsonReader& reader) {
    for (const auto& [is_given, part] :
         {std::pair(mask.label.has_value(), label), std::pair(mask.segment.has_value(), segment),
          std::pair(mask.threshold.has_value(), threshold)})
      if (is_given && !mask.file) reader.refuse(Reason::bad_value, part.c_str(), "needs a \"" + key + "\"");
    if (mask.segment && mask.label)
      reader.refuse(Reason::bad_value, segment.c_str(), "cannot be combined with \"" + label + "\"");
  });
}

template <class Codec, class Model>
void describe_model(Codec& codec, Model& model, const std::filesystem::path& folder,
                    const std::vector<guidance::Bone>& bones) {
  codec.text("name", model.name, "unique");
  codec.file("volume", model.volume, folder,
             "path of a [volume](#volumes), or of a TIFF stack; a model has this, a `surface`, or "
             "`start.landmarks` alone");
  codec.file(
      "surface", model.surface, folder,
      "path of a closed surface (at most 1 % of its edges open; of a bone: from a mask that is not "
      "grown), in mm: STL (binary or text), PLY, OBJ (its polygons), VTP (VTK's XML PolyData: text, base64 "
      "or raw, plain or zlib), or VTK's legacy PolyData (`.vtk`, text or binary). RAS, LAS or another unit "
      "that a header, comment or field data state (`SPACE=RAS`, "
      "`units: cm`) is converted to LPS and mm, an unknown one refused; no corner may lie over 1 m from "
      "the surface's middle");
  describe_mask(
      codec, "mask", model.mask, folder,
      "path of a volume on the CT's grid, or on a part of it (beyond which nothing is of the body); what is "
      "not 0 is the body. Of a TIFF stack: another stack, or a volume with as many voxels of `voxel_mm`",
      "the body");
  codec.vector(
      "window_hu", model.window_hu, hu_range,
      "`[low, high]`: the body's voxels, within the mask if there is one. Without mask and window the "
      "whole volume counts");
  describe_mask(codec, "tunnel_mask", model.tunnel_mask, folder,
                "path of a volume like `mask`: the bone that holds the plan's tunnels, where the model is "
                "several bones that lie in the images as in the CT. Absent: the model's own bone",
                "that bone");
  codec.vector("voxel_mm", model.voxel_mm, {1e-3, 100},
               "`[x, y, z]` of a TIFF stack: x along columns, y along rows, z along pages; the centre of the "
               "first voxel is the origin");
  if (codec.wants(model.tiff_offset_hu != 0))
    codec.number_or_default("tiff_offset_hu", model.tiff_offset_hu, hu_range,
                            "what is added to the values of a TIFF stack");
  codec.number("scale_sigma", model.scale_sigma, {0, 0.1},
               "relative standard deviation of the model's size (CT's voxels, threshold); 0 for an implant's "
               "exact surface. Absent: 0.005");
  codec.choice("side", model.side, side_words,
               "kept, not used; an exchanged side shows in how well the model's mirror image fits");
  describe_bone(codec, "moves_with", false, model.moves_with, bones,
                "one of the `bones`: with poses of the bone at every acquisition its motion between them is "
                "taken into account");
  if (codec.wants(model.world_from_model || model.landmarks))
    codec.object("start", model,
                 "a pose or landmarks; absent, with two views or more: every orientation and position is "
                 "[searched](registration.md#without-a-start)",
                 [&](auto& inner, auto& start) { describe_start(inner, start, folder); });
  codec.file(
      "plan", model.plan, folder,
      "path of 3D Slicer's markups: `.mrk.json` (point lists give points, lines give tunnels; "
      "`coordinateSystem` LPS, RAS or LAS, `coordinateUnits` of length are converted) or `.fcsv` (points; "
      "its `#` lines must state `CoordinateSystem`, LPS, RAS, LAS, 0 or 1, and `columns`)");
  codec.file("measures", model.measures, folder,
             "path of a [table of landmarks](howto.md#measure-quadrants-in-the-ct) in the model: quadrants "
             "and the tibial "
             "per cent of planned and of located points; rows of other models are left out");
  codec.file("zones", model.zones, folder,
             "path of a `zones.json` that replaces the built-in published positions");
  codec.check([&](JsonReader& reader) {
    const auto refuse = [&](const char* key, const char* problem) {
      reader.refuse(Reason::bad_value, key, problem);
    };
    if (model.volume && model.surface) refuse("surface", "cannot be combined with \"volume\"");
    if (model.mask.file && !model.volume) refuse("mask", "needs a \"volume\"");
    if (model.tunnel_mask.file && !model.volume) refuse("tunnel_mask", "needs a \"volume\"");
    if (model.zones && !model.measures) refuse("zones", "needs \"measures\"");
    if (model.window_hu && !(model.window_hu->x() < model.window_hu->y()))
      refuse("window_hu", "must be two increasing numbers");
    if (model.window_hu && !model.volume) refuse("window_hu", "needs a \"volume\"");
    if (model.voxel_mm && !model.volume) refuse("voxel_mm", "needs a \"volume\"");
    if (model.tiff_offset_hu != 0 && !model.volume) refuse("tiff_offset_hu", "needs a \"volume\"");
    if (!model.volume && !model.surface && !model.landmarks)
      refuse("volume", "is missing: a model needs a volume, a surface or landmarks");
  });
}

template <class Codec, class Models>
void describe_models(Codec& codec, Models& models, bool required, const std::filesystem::path& folder,
                     const std::vector<guidance::Bone>& bones) {
  std::set<std::string> names;
  codec.list("models", models, required, most_models, "to be registered, see below",
             [&](auto& entry, auto& model) {
               describe_model(entry, model, folder, bones);
               entry.check([&](JsonReader& reader) { take_name(reader, names, model.name); });
             });
}

inline constexpr Range tunnel_diameter_mm{0.5, 30}, tunnel_bridge_mm{0, 20};

/// What a line needs of its model; a bone that the tunnel names is the model's.
void check_model_line(const JsonReader& reader, const ModelLine& tunnel,
                      const std::optional<guidance::Bone>& bone, std::vector<CaseModel>& models);

/// The keys beside "name"; reading sets the `moves_with` of its model where `bone` gives it.
template <class Codec, class Tunnel>
void describe_model_line(Codec& codec, Tunnel& tunnel, std::vector<CaseModel>& models,
                         const std::vector<guidance::Bone>& bones) {
  codec.text("model", tunnel.model, "name of a model whose plan holds the line");
  codec.custom(
      "line", false, {{"type", "string"}},
      "the markups' name of the line, each for one tunnel; default: `name`",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Tunnel>)
          tunnel.line = reader.optional_text("line", 100).value_or(tunnel.name);
      },
      [&] { return std::optional<Json>(tunnel.line); });
  codec.number(
      "diameter_mm", tunnel.diameter_mm, tunnel_diameter_mm,
      "the tunnel is [compared with the bone](registration.md#tunnels-in-the-bone), for which the model "
      "needs a mask, a window or a surface");
  codec.number_or_default("bridge_mm", tunnel.bridge_mm, tunnel_bridge_mm, "bone that the wall should keep");
  codec.choice("enter_at", tunnel.enter_at, tunnel_end_words, "end of the line at which the drill enters");
  std::optional<guidance::Bone> bone;
  if constexpr (!std::is_const_v<Tunnel>)
    describe_bone(codec, "bone", false, bone, bones, "the model's `moves_with`, or gives it");
  codec.check([&](JsonReader& reader) { check_model_line(reader, tunnel, bone, models); });
}

}  // namespace helicarm::pipeline::description
