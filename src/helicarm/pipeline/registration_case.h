// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/pipeline/case.h"

namespace helicarm::pipeline {

/// An element of case.json's "models": files of a rigid body, and from where its registration starts.
struct CaseModel {
  std::string name;
  std::optional<std::filesystem::path> volume;   ///< CT; this or `surface`, or landmarks alone
  std::optional<std::filesystem::path> surface;  ///< closed, STL or PLY
  std::optional<std::filesystem::path> mask;     ///< of the volume
  std::optional<Eigen::Vector2d> window_hu;
  std::optional<Eigen::Vector3d> voxel_mm;  ///< of a TIFF stack
  double tiff_offset_hu = 0;                ///< added to a TIFF stack's values
  std::optional<std::string> side;          ///< left or right
  std::optional<guidance::Bone> moves_with;
  std::optional<geometry::RigidTransform> world_from_model;  ///< start
  std::optional<std::filesystem::path> landmarks;            ///< start: CSV of points that are also picked
  std::optional<std::filesystem::path> plan;                 ///< Slicer markups
};

/// A case with models. Either all views have cameras of other programs, then the world is theirs and the
/// calibrator may be missing, or none has.
struct RegistrationCase {
  Case base;
  std::vector<std::filesystem::path> cameras;  ///< one per view, or empty
  std::vector<CaseModel> models;
};

/// Reads a case with "models". Fails as `read_case`.
Expected<RegistrationCase> read_registration_case(const std::filesystem::path& path);

}  // namespace helicarm::pipeline
