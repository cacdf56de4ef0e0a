// SPDX-License-Identifier: Apache-2.0
#include "gui/window/c_arm_presets.h"

#include <QStringList>
#include <algorithm>

#include "helicarm/core/json.h"

namespace helicarm::gui {
namespace {

constexpr const char* key = "c_arm_presets";

Json text_or_null(const std::optional<std::filesystem::path>& file) {
  return file ? Json(file->string()) : Json(nullptr);
}

std::string text_of(const CArmPreset& preset) {
  Json views = Json::object();
  for (const auto& [view, of_view] : preset.views)
    views[view] = {{"plate_image", text_or_null(of_view.plate_image)}, {"map", text_or_null(of_view.map)}};
  return Json{{"name", preset.name},
              {"intensifier", preset.intensifier},
              {"calibrator", preset.calibrator},
              {"plate", preset.plate ? Json(*preset.plate) : Json(nullptr)},
              {"views", views}}
      .dump();
}

std::optional<std::filesystem::path> file_in(const Json& json, const char* name) {
  return json.at(name).is_null() ? std::nullopt
                                 : std::optional<std::filesystem::path>(json.at(name).get<std::string>());
}

std::optional<CArmPreset> preset_from(const std::string& text) try {
  const Json json = Json::parse(text);
  CArmPreset preset{json.at("name").get<std::string>(),
                    json.at("intensifier").get<std::string>(),
                    json.at("calibrator").get<std::string>(),
                    {},
                    {}};
  if (!json.at("plate").is_null()) preset.plate = json.at("plate").get<std::string>();
  for (const auto& [view, of_view] : json.at("views").items())
    preset.views[view] = {file_in(of_view, "plate_image"), file_in(of_view, "map")};
  return preset;
} catch (const Json::exception&) {
  return std::nullopt;
}

void keep(QSettings& settings, std::vector<CArmPreset> presets) {
  std::ranges::sort(presets, {}, &CArmPreset::name);
  QStringList entries;
  for (const CArmPreset& preset : presets) entries << QString::fromStdString(text_of(preset));
  settings.setValue(key, entries);
}

}  // namespace

std::vector<CArmPreset> c_arm_presets(const QSettings& settings) {
  std::vector<CArmPreset> presets;
  for (const QString& entry : settings.value(key).toStringList())
    if (auto preset = preset_from(entry.toStdString())) presets.push_back(*std::move(preset));
  return presets;
}

void keep_preset(QSettings& settings, const CArmPreset& preset) {
  auto presets = c_arm_presets(settings);
  std::erase_if(presets, [&](const CArmPreset& other) { return other.name == preset.name; });
  presets.push_back(preset);
  keep(settings, std::move(presets));
}

void forget_preset(QSettings& settings, const std::string& name) {
  auto presets = c_arm_presets(settings);
  std::erase_if(presets, [&](const CArmPreset& other) { return other.name == name; });
  keep(settings, std::move(presets));
}

}  // namespace helicarm::gui
