// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// What a user states of an image beside the file: in a sidecar, or in a view of a case.
struct StatedGeometry {
  std::optional<double> pixel_mm = {};  ///< in the receiver's plane
  std::optional<double> source_detector_mm = {};
  std::optional<double> primary_deg = {}, secondary_deg = {};  ///< positioner angles, as DICOM counts them
};

/// The sidecar beside an image, where there is one: NAME.png.json or NAME.json. A JSON file of another kind,
/// such as a camera, is none.
std::optional<std::filesystem::path> sidecar_of(const std::filesystem::path& image);

/// The one of the image's whole name, NAME.dcm.json: a DICOM file has no other.
std::optional<std::filesystem::path> full_sidecar_of(const std::filesystem::path& image);

/// A JSON file beside the image that has a sidecar's name and is none, for a message.
std::optional<std::filesystem::path> other_json_of(const std::filesystem::path& image);

/// Fails with the codes of JSON, or bad_value.
Expected<StatedGeometry> read_sidecar(const std::filesystem::path& path);

/// What the sidecars beside an image state together, and the name of the first; nothing without one.
/// `full_name_only`: as `full_sidecar_of`. Refuses bad_value where two state different values.
Expected<std::optional<std::pair<StatedGeometry, std::string>>> stated_beside(
    const std::filesystem::path& image, bool full_name_only);

/// Gives the image what its file does not state; `origin` names who states it. A pixel size takes the warning
/// spacing_missing away. Refuses bad_value where the file's own value differs by more than 1 %, an angle by
/// more than 1 degree.
Expected<void> state_geometry(XrayImage& xray_image, const StatedGeometry& stated, const std::string& origin);

}  // namespace helicarm::xray
