// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/registration_case.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/case_json.h"
#include "helicarm/pipeline/poses_json.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_models = 20;
constexpr Range hu_range{-32768, 32767};
constexpr Range scale_sigma_range{0, 0.1};
constexpr Range diameter_range{0.5, 30}, bridge_range{0, 20};

std::optional<fs::path> model_file(JsonReader& reader, const char* key, const fs::path& folder) {
  const auto name = reader.optional_text(key, 1000);
  if (!name) return std::nullopt;
  return value_or_throw(path_inside(folder, *name));
}

void read_start(JsonReader reader, const fs::path& folder, CaseModel& model) {
  if (!reader.raw("world_from_model").is_null())
    model.world_from_model =
        value_or_throw(pose_as_written(geometry::matrix_from(reader, "world_from_model", {-1e5, 1e5}),
                                       reader.where() + ": \"world_from_model\""));
  model.landmarks = model_file(reader, "landmarks", folder);
  if (model.world_from_model && model.landmarks)
    reader.refuse(Reason::bad_value, "landmarks", "cannot be combined with \"world_from_model\"");
  reader.finish();
}

CaseModel model_from(JsonReader& reader, const fs::path& folder, const std::vector<guidance::Bone>& bones) {
  CaseModel model;
  model.name = reader.text("name", 100);
  if (model.name.empty()) reader.refuse(Reason::bad_value, "name", "is empty");
  model.volume = model_file(reader, "volume", folder);
  model.surface = model_file(reader, "surface", folder);
  if (model.volume && model.surface)
    reader.refuse(Reason::bad_value, "surface", "cannot be combined with \"volume\"");
  model.mask = model_file(reader, "mask", folder);
  if (model.mask && !model.volume) reader.refuse(Reason::bad_value, "mask", "needs a \"volume\"");
  if (!reader.raw("window_hu").is_null()) {
    model.window_hu = Eigen::Vector2d(reader.numbers("window_hu", 2, hu_range).data());
    if (!(model.window_hu->x() < model.window_hu->y()))
      reader.refuse(Reason::bad_value, "window_hu", "must be two increasing numbers");
    if (!model.volume) reader.refuse(Reason::bad_value, "window_hu", "needs a \"volume\"");
  }
  if (!reader.raw("voxel_mm").is_null())
    model.voxel_mm = Eigen::Vector3d(reader.numbers("voxel_mm", 3, {1e-3, 100}).data());
  model.tiff_offset_hu = reader.optional_number("tiff_offset_hu", hu_range).value_or(0);
  model.scale_sigma = reader.optional_number("scale_sigma", scale_sigma_range);
  if (!reader.raw("side").is_null())
    model.side = reader.choice("side", {"left", "right"}) == 0 ? "left" : "right";
  if (!reader.raw("moves_with").is_null()) model.moves_with = bone_from(reader, "moves_with", bones);
  if (!reader.raw("start").is_null()) read_start(reader.object("start"), folder, model);
  model.plan = model_file(reader, "plan", folder);
  if (!model.volume && !model.surface && !model.landmarks)
    reader.refuse(Reason::bad_value, "volume", "is missing: a model needs a volume, a surface or landmarks");
  reader.finish();
  return model;
}

std::vector<ModelTunnelPlan> model_tunnels_from(const Json& json, const std::string& origin,
                                                std::vector<CaseModel>& models,
                                                const std::vector<guidance::Bone>& bones) {
  const Json list = {{"tunnels", json}};
  JsonReader reader(list, origin);
  std::vector<ModelTunnelPlan> tunnels;
  for (JsonReader& entry : reader.objects("tunnels", false, most_models * 50)) {
    const std::string name = entry.text("name", 100);
    if (name.empty()) entry.refuse(Reason::bad_value, "name", "is empty");
    if (std::ranges::find(tunnels, name, &ModelTunnelPlan::name) != tunnels.end())
      entry.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", name));
    tunnels.push_back(model_tunnel_from(entry, name, models, bones));
    entry.finish();
  }
  return tunnels;
}

/// Takes "camera" out of every view: the rest is a case like any other.
std::vector<fs::path> take_cameras(Json& json, const fs::path& file) {
  std::vector<fs::path> cameras;
  if (!json.is_object() || !json.contains("views") || !json["views"].is_array()) return cameras;
  std::size_t index = 0;
  for (Json& view : json["views"]) {
    const std::string where = fmt::format("{}: views[{}]", file.filename().string(), index++);
    if (!view.is_object()) continue;
    if (const auto found = view.find("camera"); found != view.end() && !found->is_null()) {
      if (!found->is_string())
        throw BadInput(Reason::bad_value, fmt::format("{}: \"camera\" is not a file name", where));
      cameras.push_back(value_or_throw(path_inside(file.parent_path(), found->get<std::string>())));
    }
    view.erase("camera");
    if (!cameras.empty() && cameras.size() != index)
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"camera\" must be given for all views or for none: their world is one", where));
  }
  return cameras;
}

constexpr std::string_view placeholder = "{frame";

/// `name` with the frame's number, or nothing without a placeholder.
std::optional<std::string> numbered(const std::string& name, int frame) {
  static const std::regex forms(R"(\{frame(?::0([1-9])d)?\})");
  if (name.find(placeholder) == std::string::npos) return std::nullopt;
  std::string made, rest = name;
  for (std::smatch match; std::regex_search(rest, match, forms); rest = match.suffix())
    made += match.prefix().str() + fmt::format("{:0{}}", frame, match[1].matched ? std::stoi(match[1]) : 1);
  if (made.empty() || rest.find(placeholder) != std::string::npos)
    throw BadInput(Reason::bad_value, fmt::format("views: \"image\": \"{}\": write {{frame}} or, for leading "
                                                  "zeros, {{frame:03d}}",
                                                  name));
  return made + rest;
}

}  // namespace

std::vector<CaseModel> models_from(JsonReader& reader, const fs::path& folder,
                                   const std::vector<guidance::Bone>& bones) {
  std::vector<CaseModel> models;
  for (JsonReader& entry : reader.objects("models", true, most_models)) {
    CaseModel model = model_from(entry, folder, bones);
    if (std::ranges::find(models, model.name, &CaseModel::name) != models.end())
      entry.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", model.name));
    models.push_back(std::move(model));
  }
  return models;
}

ModelTunnelPlan model_tunnel_from(JsonReader& reader, const std::string& name, std::vector<CaseModel>& models,
                                  const std::vector<guidance::Bone>& bones) {
  ModelTunnelPlan tunnel{name, reader.text("model", 100), {}, {}};
  const auto model = std::ranges::find(models, tunnel.model, &CaseModel::name);
  if (model == models.end())
    reader.refuse(Reason::bad_value, "model", fmt::format("\"{}\" is not one of \"models\"", tunnel.model));
  if (!model->plan)
    reader.refuse(Reason::bad_value, "model",
                  fmt::format("\"{}\" has no \"plan\", which holds the line", tunnel.model));
  tunnel.line = reader.optional_text("line", 100).value_or(name);
  if (!reader.raw("bone").is_null()) {
    const guidance::Bone bone = bone_from(reader, "bone", bones);
    if (model->moves_with && *model->moves_with != bone)
      reader.refuse(Reason::bad_value, "bone",
                    fmt::format("is \"{}\", but the model \"{}\" moves with \"{}\"", bone, tunnel.model,
                                *model->moves_with));
    model->moves_with = bone;
  }
  tunnel.diameter_mm = reader.optional_number("diameter_mm", diameter_range);
  const bool outlined = model->surface || model->mask || model->window_hu;
  if (tunnel.diameter_mm && !outlined)
    reader.refuse(Reason::bad_value, "diameter_mm",
                  fmt::format("cannot be compared with the bone: give the model \"{}\" a \"mask\", "
                              "\"window_hu\" or a \"surface\"",
                              tunnel.model));
  tunnel.bridge_mm = reader.optional_number("bridge_mm", bridge_range).value_or(usual_bridge_mm);
  if (!reader.raw("enter_at").is_null())
    tunnel.enters_at_end = reader.choice("enter_at", {"start", "end"}) == 1;
  return tunnel;
}

Json to_json(const CaseModel& model, const fs::path& folder) {
  Json json = {{"name", model.name}};
  const auto put = [&](const char* key, const std::optional<fs::path>& file) {
    if (file) json[key] = file->lexically_relative(folder).generic_string();
  };
  put("volume", model.volume), put("surface", model.surface), put("mask", model.mask),
      put("plan", model.plan);
  if (model.window_hu) json["window_hu"] = geometry::json_list(*model.window_hu);
  if (model.voxel_mm) json["voxel_mm"] = geometry::json_list(*model.voxel_mm);
  if (model.tiff_offset_hu != 0) json["tiff_offset_hu"] = model.tiff_offset_hu;
  if (model.scale_sigma) json["scale_sigma"] = *model.scale_sigma;
  if (model.side) json["side"] = *model.side;
  if (model.moves_with) json["moves_with"] = *model.moves_with;
  if (model.world_from_model)
    json["start"] = {{"world_from_model", geometry::json_rows(model.world_from_model->matrix())}};
  if (model.landmarks)
    json["start"] = {{"landmarks", model.landmarks->lexically_relative(folder).generic_string()}};
  return json;
}

bool has_models(const fs::path& path) {
  const auto json = read_json(case_file(path));
  return json && json->is_object() && json->contains("models") && !(*json)["models"].empty();
}

namespace {

Expected<RegistrationCase> read_with_models(const fs::path& path, Purpose purpose) {
  return guarded([&] {
    const fs::path file = fs::absolute(case_file(path));
    Json json = value_or_throw(read_json(file));
    RegistrationCase read;
    read.cameras = take_cameras(json, file);
    const Json tunnels = take_model_tunnels(json);
    Json models = Json::object();
    if (json.is_object() && json.contains("models")) models["models"] = json["models"];
    if (json.is_object()) json.erase("models");
    if (purpose == Purpose::run && !read.cameras.empty())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"camera\": the views bring cameras of their own; register the models to "
                      "them by `helicarm register`",
                      file.filename().string()));
    read.base = case_of(json, file.filename().string(), file.parent_path(),
                        read.cameras.empty() ? purpose : Purpose::cameras);
    JsonReader reader(models, file.filename().string());
    read.models = models_from(reader, read.base.folder, read.base.bones);
    if (read.models.empty())
      reader.refuse(Reason::bad_value, "models", "is empty: name a volume or a surface");
    read.tunnels = model_tunnels_from(tunnels, file.filename().string(), read.models, read.base.bones);
    return read;
  });
}

}  // namespace

Expected<RegistrationCase> read_registration_case(const fs::path& path) {
  return read_with_models(path, Purpose::registration);
}

Expected<RegistrationCase> read_measured_case(const fs::path& path) {
  if (has_models(path)) return read_with_models(path, Purpose::run);
  return read_case(path).map([](Case base) { return RegistrationCase{std::move(base), {}, {}}; });
}

bool is_sequence(const RegistrationCase& given) {
  return std::ranges::any_of(given.base.views, [](const CaseView& view) {
    return view.image.filename().string().find(placeholder) != std::string::npos;
  });
}

Expected<RegistrationCase> at_frame(RegistrationCase given, int frame) {
  return guarded([&] {
    for (CaseView& view : given.base.views)
      if (const auto name = numbered(view.image.filename().string(), frame))
        view.image.replace_filename(*name);
      else
        view.frame = frame;
    return std::move(given);
  });
}

}  // namespace helicarm::pipeline
