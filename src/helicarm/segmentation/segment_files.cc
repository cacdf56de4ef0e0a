// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/segment_files.h"

#include <chrono>

#include <fmt/format.h>

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/segmentation/bone_mesh.h"
#include "helicarm/segmentation/bones.h"
#include "helicarm/segmentation/slices.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/tiff_stack.h"
#include "helicarm/volume/write_nrrd.h"

namespace helicarm::segmentation {
namespace {

namespace fs = std::filesystem;
using geometry::json_list, geometry::json_rows;

volume::Volume volume_of(const fs::path& path, const SegmentRequest& request, double offset_hu) {
  if (!volume::is_tiff_stack(path)) return value_or_throw(volume::read_volume(path));
  if (!request.voxel_mm)
    throw BadInput(
        Reason::usage,
        fmt::format("{}: a TIFF stack needs the size of its voxels (voxel_mm, --voxel)", path.string()));
  return value_or_throw(volume::tiff_stack(path, *request.voxel_mm, offset_hu));
}

Json json_of(const Bone& bone, const Segmentation& made, double area_cm2) {
  Json json = {{"name", bone.name},
               {"label", bone.label},
               {"seed_mm", bone.seed ? json_list(*bone.seed) : Json(nullptr)},
               {"seed_hu", bone.seed_hu ? Json(*bone.seed_hu) : Json(nullptr)},
               {"voxels", bone.voxels},
               {"volume_cm3", bone.volume_cm3},
               {"surface_cm2", area_cm2},
               {"centre_mm", json_list(bone.centre)},
               {"box_mm", {{"low", json_list(bone.box.min())}, {"high", json_list(bone.box.max())}}},
               {"box_voxels", {{"low", bone.low}, {"high", bone.high}}},
               {"cut_off", bone.cut_off},
               {"contacts", Json::array()},
               {"left_out_cm3", bone.left_out_cm3},
               {"left_out_percent", bone.left_out_percent},
               {"mask", bone.name + ".nrrd"},
               {"surface", bone.name + ".stl"}};
  for (const Contact& contact : bone.contacts)
    json["contacts"].push_back({{"with", contact.with.empty() ? Json(nullptr) : Json(contact.with)},
                                {"with_cm3", contact.with_cm3},
                                {"neck_mm", contact.neck_mm},
                                {"width", contact.width},
                                {"at_mm", json_list(contact.at)}});
  if (!made.threshold_hu)
    for (const char* key : {"contacts", "left_out_cm3", "left_out_percent"}) json.erase(key);
  return json;
}

void check_inputs_stay(const SegmentAnswer& answer, const fs::path& folder) {
  for (const Bone& bone : answer.segmentation.bones)
    for (const fs::path& input : answer.inputs) {
      std::error_code none;
      if (const fs::path file = folder / (bone.name + ".nrrd"); fs::equivalent(file, input, none))
        throw BadInput(
            Reason::name_clash,
            fmt::format("{}: the mask of {} would replace this file, which is read: choose another "
                        "name or folder",
                        file.string(), bone.name));
    }
}

}  // namespace

Expected<SegmentAnswer> answer(const SegmentRequest& request, const pipeline::Progress& progress) {
  return guarded([&] {
    if (request.seeds.empty() != request.label_map.has_value())
      throw BadInput(Reason::usage,
                     request.label_map
                         ? "segment: seeds cannot be combined with a label map"
                         : "segment: give a seed NAME=x,y,z for each bone (--seed), or a label map "
                           "(--labels)");
    if (!request.labels.empty() && !request.label_map)
      throw BadInput(Reason::usage, "segment: a label needs the label map (--labels)");
    if (request.label_map && request.options.threshold_hu)
      throw BadInput(Reason::usage, "segment: a threshold cannot be combined with a label map");
    if (request.voxel_mm && !volume::is_tiff_stack(request.ct))
      throw BadInput(Reason::usage,
                     fmt::format("segment: voxel_mm is for TIFF stacks only; {} states its own",
                                 request.ct.filename().string()));
    const auto begin = std::chrono::steady_clock::now();
    progress.begin("read");
    SegmentAnswer made;
    const fs::path whole = fs::absolute(request.ct).lexically_normal();
    made.ct_name = (whole.has_filename() ? whole : whole.parent_path()).filename().string();
    made.inputs.push_back(request.ct);
    if (request.label_map) made.inputs.push_back(*request.label_map);
    made.ct = volume_of(request.ct, request, request.tiff_offset_hu);
    for (Warning& warning : value_or_throw(volume::check_hounsfield(made.ct, made.ct_name)))
      made.ct.warnings.push_back(std::move(warning));
    made.options = request.options;
    made.of_label_map = request.label_map.has_value();
    if (request.label_map) {
      volume::Volume map = volume_of(*request.label_map, request, 0);
      // A stack has no frame of its own: a map drawn on it in another program brings that program's.
      if (request.voxel_mm && volume::has_spacing(map, *request.voxel_mm))
        map.patient_from_voxel = made.ct.patient_from_voxel;
      made.segmentation = value_or_throw(
          segmentation_from(made.ct, std::move(map), request.labels, request.label_map->filename().string()));
    } else {
      made.segmentation = value_or_throw(segment(made.ct, request.seeds, request.options, progress));
    }
    auto& warnings = made.segmentation.warnings;
    warnings.insert(warnings.begin(), made.ct.warnings.begin(), made.ct.warnings.end());
    made.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return made;
  });
}

Json to_json(const SegmentAnswer& answer, const std::vector<double>& areas_cm2) {
  const Segmentation& made = answer.segmentation;
  Json json = {{"format", "helicarm-segmentation/1"},
               {"status", "ok"},
               {"failure", nullptr},
               {"volume",
                {{"file", answer.ct_name},
                 {"size", made.size},
                 {"spacing_mm", json_list(made.patient_from_voxel.linear().colwise().norm().transpose())},
                 {"patient_from_voxel", json_rows(made.patient_from_voxel.matrix())}}},
               {"threshold_hu", made.threshold_hu ? Json(*made.threshold_hu) : Json(nullptr)},
               {"gap_mm", answer.of_label_map ? Json(nullptr) : Json(answer.options.gap_mm)},
               {"neck", answer.of_label_map ? Json(nullptr) : Json(answer.options.neck)},
               {"bones", Json::array()},
               {"warnings", pipeline::json_list_of(made.warnings)},
               {"notes", pipeline::json_list_of(made.notes)},
               {"seconds", answer.seconds}};
  for (std::size_t i = 0; i < made.bones.size(); ++i)
    json["bones"].push_back(json_of(made.bones[i], made, areas_cm2[i]));
  return json;
}

Json refused_json(const Failure& refusal) {
  return {{"format", "helicarm-segmentation/1"},
          {"status", "refused"},
          {"failure", pipeline::to_json(refusal)},
          {"bones", Json::array()},
          {"warnings", Json::array()},
          {"notes", Json::array()}};
}

Expected<Json> write_segmentation(const SegmentAnswer& answer, const std::optional<fs::path>& folder,
                                  const pipeline::Progress& progress) {
  return guarded([&] {
    progress.begin("surface");
    const Segmentation& made = answer.segmentation;
    if (folder) check_inputs_stay(answer, *folder);
    std::vector<double> areas;
    std::vector<std::uint8_t> mask(made.labels.size());
    for (const Bone& bone : made.bones) {
      if (progress.view) progress.view();
      const phantom::TriangleMesh mesh = surface_of(answer.ct, made, bone);
      areas.push_back(area_cm2(mesh));
      if (!folder) continue;
      for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = made.labels[i] == bone.label;
      value_or_throw(write_file(*folder / (bone.name + ".stl"), stl_in_lps(mesh)));
      value_or_throw(write_file(*folder / (bone.name + ".nrrd"),
                                volume::to_nrrd(made.size, made.patient_from_voxel, mask)));
    }
    Json json = to_json(answer, areas);
    if (folder) {
      value_or_throw(write_file(*folder / "segment.png", slices_png(answer.ct, made)));
      value_or_throw(write_file(*folder / "segment.json", to_text(json) + "\n"));
    }
    return json;
  });
}

void forget_segmentation(const fs::path& folder, const SegmentRequest& request) {
  std::vector<std::string> names{"segment.png"};
  if (const auto json = read_json(folder / "segment.json");
      json && json->is_object() && json->contains("bones") && (*json)["bones"].is_array())
    for (const Json& bone : (*json)["bones"])
      if (bone.is_object() && bone.contains("name") && bone["name"].is_string())
        if (const std::string name = bone["name"]; check_name(name))
          names.push_back(name + ".nrrd"), names.push_back(name + ".stl");
  names.push_back("segment.json");  // last: an interrupted removal can be repeated
  std::vector<fs::path> inputs{request.ct};
  if (request.label_map) inputs.push_back(*request.label_map);
  forget_files(folder, names, inputs);
}

}  // namespace helicarm::segmentation
