// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/unsaved_landmarks.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"

namespace helicarm::gui {
namespace fs = std::filesystem;
using pipeline::CaseModel;
using pipeline::PointInModel;

namespace {

constexpr const char* unsaved_landmarks_name = "unsaved_landmarks.json";
constexpr Range place_range{-1e5, 1e5};  // mm, wider than every scanner's coordinates

/// Of one model.
std::vector<PointInModel> points_from(JsonReader& model) {
  std::vector<PointInModel> points;
  for (JsonReader& point : model.objects("landmarks", true)) {
    PointInModel read;
    read.name = point.text("name");
    const std::vector<double> at = point.numbers("in_model", 3, place_range);
    read.in_model = {at[0], at[1], at[2]};
    point.finish();
    if (std::ranges::find(points, read.name, &PointInModel::name) != points.end())
      point.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", read.name));
    points.push_back(std::move(read));
  }
  return points;
}

}  // namespace

const std::vector<PointInModel>& of_model(const ModelLandmarks& landmarks, std::size_t model) {
  static const std::vector<PointInModel> none;
  return model < landmarks.size() ? landmarks[model] : none;
}

bool are_same(const std::vector<PointInModel>& a, const std::vector<PointInModel>& b) {
  return std::ranges::equal(a, b, [](const PointInModel& one, const PointInModel& other) {
    return one.name == other.name && one.in_model == other.in_model;
  });
}

bool are_same(const ModelLandmarks& a, const ModelLandmarks& b) {
  return std::ranges::equal(a, b, [](const auto& one, const auto& other) { return are_same(one, other); });
}

ModelLandmarks landmarks_from(const Json& json, const std::vector<CaseModel>& models, ModelLandmarks saved) {
  ModelLandmarks landmarks = std::move(saved);
  JsonReader reader(json, unsaved_landmarks_name);
  for (JsonReader& model : reader.objects("models", true)) {
    const std::string name = model.text("name");
    std::vector<PointInModel> points = points_from(model);
    model.finish();
    const auto same = std::ranges::find(models, name, &CaseModel::name);
    if (same != models.end()) landmarks.at(std::size_t(same - models.begin())) = std::move(points);
  }
  reader.finish();
  return landmarks;
}

std::optional<Json> unsaved_json(const std::vector<CaseModel>& models, const ModelLandmarks& placed,
                                 const ModelLandmarks& saved) {
  Json changed = Json::array();
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (are_same(of_model(placed, i), of_model(saved, i))) continue;
    Json points = Json::array();
    for (const PointInModel& point : of_model(placed, i))
      points.push_back(
          {{"name", point.name}, {"in_model", {point.in_model.x(), point.in_model.y(), point.in_model.z()}}});
    changed.push_back({{"name", models[i].name}, {"landmarks", std::move(points)}});
  }
  if (changed.empty()) return std::nullopt;
  return Json{{"models", std::move(changed)}};
}

Expected<std::optional<ModelLandmarks>> unsaved_landmarks(const fs::path& case_folder,
                                                          const std::vector<CaseModel>& models,
                                                          const ModelLandmarks& saved) {
  const fs::path file = case_folder / unsaved_landmarks_name;
  if (!fs::exists(file)) return std::nullopt;
  return read_json(file).and_then([&](const Json& json) {
    return guarded([&] { return std::optional(landmarks_from(json, models, saved)); });
  });
}

Expected<void> keep_unsaved_landmarks(const fs::path& case_folder, const std::vector<CaseModel>& models,
                                      const ModelLandmarks& placed, const ModelLandmarks& saved) {
  const fs::path file = case_folder / unsaved_landmarks_name;
  if (const auto json = unsaved_json(models, placed, saved))
    return write_file_in_folder(file, to_text(*json) + "\n");
  std::error_code gone;
  fs::remove(file, gone);
  return {};
}

}  // namespace helicarm::gui
