// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/registration_case.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "helicarm/pipeline/model_description.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

std::vector<ModelTunnelPlan> model_tunnels_from(const Json& json, const std::string& origin,
                                                std::vector<CaseModel>& models,
                                                const std::vector<guidance::Bone>& bones) {
  const Json list = {{"tunnels", json}};
  JsonReader reader(list, origin);
  FromJson codec(reader);
  std::vector<ModelTunnelPlan> tunnels;
  std::set<std::string> names;
  codec.list("tunnels", tunnels, false, description::most_models * 50, "", [&](auto& entry, auto& tunnel) {
    entry.text("name", tunnel.name, "");
    entry.check([&](JsonReader& at) { description::take_name(at, names, tunnel.name); });
    description::describe_model_line(entry, tunnel, models, bones);
  });
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

/// Takes "frame_offset" out of every view.
std::vector<int> take_frame_offsets(Json& json, const std::string& origin) {
  constexpr int most = 1000000;
  std::vector<int> offsets;
  if (!json.is_object() || !json.contains("views") || !json["views"].is_array()) return offsets;
  for (Json& view : json["views"]) {
    int& offset = offsets.emplace_back(0);
    if (!view.is_object() || !view.contains("frame_offset")) continue;
    const Json taken = {{"frame_offset", view["frame_offset"]}};
    JsonReader reader(taken, fmt::format("{}: views[{}]", origin, offsets.size() - 1));
    if (reader.has("frame_offset")) offset = reader.integer("frame_offset", -most, most);
    view.erase("frame_offset");
  }
  return offsets;
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

void description::check_model_line(const JsonReader& reader, const ModelTunnelPlan& tunnel,
                                   const std::optional<guidance::Bone>& bone,
                                   std::vector<CaseModel>& models) {
  const auto model = std::ranges::find(models, tunnel.model, &CaseModel::name);
  const auto refuse = [&](const char* key, const std::string& how) {
    reader.refuse(Reason::bad_value, key, how);
  };
  if (model == models.end()) refuse("model", fmt::format("\"{}\" is not one of \"models\"", tunnel.model));
  if (!model->plan)
    refuse("model", fmt::format("\"{}\" has no \"plan\", which holds the line", tunnel.model));
  if (bone && model->moves_with && *model->moves_with != *bone)
    refuse("bone", fmt::format("is \"{}\", but the model \"{}\" moves with \"{}\"", *bone, tunnel.model,
                               *model->moves_with));
  if (bone) model->moves_with = bone;
  if (tunnel.diameter_mm && !model->surface && !model->mask && !model->window_hu)
    refuse("diameter_mm", fmt::format("cannot be compared with the bone: give the model \"{}\" a \"mask\", "
                                      "\"window_hu\" or a \"surface\"",
                                      tunnel.model));
}

Json to_json(const CaseModel& model, const fs::path& folder) {
  ToJson codec;
  description::describe_model(codec, model, folder, {});
  return std::move(codec.json);
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
    if (purpose == Purpose::registration)
      read.frame_offsets = take_frame_offsets(json, file.filename().string());
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
    FromJson codec(reader);
    description::describe_models(codec, read.models, true, read.base.folder, read.base.bones);
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
    for (std::size_t i = 0; i < given.base.views.size(); ++i) {
      CaseView& view = given.base.views[i];
      const int number = frame + (i < given.frame_offsets.size() ? given.frame_offsets[i] : 0);
      if (const auto name = numbered(view.image.filename().string(), number))
        view.image.replace_filename(*name);
      else
        view.frame = number;
    }
    return std::move(given);
  });
}

}  // namespace helicarm::pipeline
