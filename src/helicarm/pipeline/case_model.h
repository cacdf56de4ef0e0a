// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/json.h"
#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/guidance/poses.h"

namespace helicarm::pipeline {

enum class Side { left, right };

/// The voxels of a volume that are of one body: those that are not 0, or a part of them.
struct CaseMask {
  std::optional<std::filesystem::path> file = {};
  std::optional<int> label = {};            ///< of a label map; nothing: it has only one
  std::optional<std::string> segment = {};  ///< the same by the label of a DICOM segmentation's segment
  std::optional<double> threshold = {};     ///< of a fractional DICOM segmentation: share from which on
};

/// A point in the coordinates of a model's files, mm.
struct PointInModel {
  std::string name;
  Eigen::Vector3d in_model;
};

/// An element of "models": files of a rigid body, and from where its registration starts.
struct CaseModel {
  std::string name;
  std::optional<std::filesystem::path> volume;   ///< CT; this or `surface`, or landmarks alone
  std::optional<std::filesystem::path> surface;  ///< closed: STL, PLY or VTP
  CaseMask mask;                                 ///< of the volume
  std::optional<Eigen::Vector2d> window_hu;
  std::optional<Eigen::Vector3d> voxel_mm;  ///< of a TIFF stack
  double tiff_offset_hu = 0;                ///< added to a TIFF stack's values
  std::optional<double> scale_sigma;        ///< relative, of the model's size
  std::optional<Side> side;                 ///< not used
  std::optional<guidance::Bone> moves_with;
  std::optional<geometry::RigidTransform> world_from_model;  ///< start
  std::optional<std::filesystem::path> landmarks;            ///< start: CSV of points that are also picked
  std::vector<PointInModel> placed_landmarks = {};     ///< start, instead of `landmarks`: placed by a person
  std::optional<std::filesystem::path> plan;           ///< Slicer markups
  CaseMask tunnel_mask = {};                           ///< of the bone that holds the tunnels, if not of all
  std::optional<std::filesystem::path> measures = {};  ///< table of landmarks for measures in the bone
  std::optional<std::filesystem::path> zones = {};     ///< published positions; nothing: those built in
};

/// Bird et al. (2011): the least bridge of bone between a tunnel and the bone's surface, mm.
inline constexpr double usual_bridge_mm = 2;

enum class TunnelEnd { start, end };
inline constexpr std::array<std::string_view, 2> tunnel_end_words{"start", "end"};

/// An element of "tunnels" that names a model: a line of its plan as a tunnel with a diameter.
struct ModelLine {
  std::string name;
  std::string model;
  std::string line;                       ///< in the model's plan; its name unless given
  std::optional<double> diameter_mm;      ///< nothing: only the axis is compared with the bone
  double bridge_mm = usual_bridge_mm;     ///< below it is warned
  TunnelEnd enter_at = TunnelEnd::start;  ///< of the line, where the drill enters
};

/// An element of "models"; its files relative to `folder`.
Json to_json(const CaseModel& model, const std::filesystem::path& folder);

}  // namespace helicarm::pipeline
