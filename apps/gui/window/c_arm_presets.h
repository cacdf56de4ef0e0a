// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QSettings>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace helicarm::gui {

/// How a view's distortion is known if no plate is in its image.
struct ViewPlate {
  std::optional<std::filesystem::path> plate_image, map;

  bool operator==(const ViewPlate&) const = default;
};

/// What stays the same from case to case with one C-arm.
struct CArmPreset {
  std::string name;
  std::string intensifier;           ///< or detector, in the user's words; goes into the case's notes
  std::string calibrator;            ///< a built-in or a file
  std::optional<std::string> plate;  ///< a built-in, a file, or "none"; nothing: by the images
  std::map<std::string, ViewPlate> views;

  bool operator==(const CArmPreset&) const = default;
};

/// The kept presets by name; entries that cannot be read are left out.
std::vector<CArmPreset> c_arm_presets(const QSettings& settings);

/// Replaces the one of its name.
void keep_preset(QSettings& settings, const CArmPreset& preset);

void forget_preset(QSettings& settings, const std::string& name);

}  // namespace helicarm::gui
