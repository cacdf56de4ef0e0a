// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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
  std::optional<std::filesystem::path> surface;  ///< closed: STL, PLY or VTP
  std::optional<std::filesystem::path> mask;     ///< of the volume
  std::optional<Eigen::Vector2d> window_hu;
  std::optional<Eigen::Vector3d> voxel_mm;  ///< of a TIFF stack
  double tiff_offset_hu = 0;                ///< added to a TIFF stack's values
  std::optional<double> scale_sigma;        ///< relative, of the model's size
  std::optional<Side> side;                 ///< not used
  std::optional<guidance::Bone> moves_with;
  std::optional<geometry::RigidTransform> world_from_model;  ///< start
  std::optional<std::filesystem::path> landmarks;            ///< start: CSV of points that are also picked
  std::optional<std::filesystem::path> plan;                 ///< Slicer markups
};

/// Bird et al. (2011): the least bridge of bone between a tunnel and the bone's surface, mm.
inline constexpr double usual_bridge_mm = 2;

enum class TunnelEnd { start, end };
inline constexpr std::array<std::string_view, 2> tunnel_end_words{"start", "end"};

/// An element of "tunnels" that names a model: a line of its plan as a tunnel with a diameter.
struct ModelTunnelPlan {
  std::string name;
  std::string model;
  std::string line;                       ///< in the model's plan; its name unless given
  std::optional<double> diameter_mm;      ///< nothing: only the axis is compared with the bone
  double bridge_mm = usual_bridge_mm;     ///< below it is warned
  TunnelEnd enter_at = TunnelEnd::start;  ///< of the line, where the drill enters
};

/// A case with models. Either all views have cameras of other programs, then the world is theirs and the
/// calibrator may be missing, or none has.
struct RegistrationCase {
  Case base;
  std::vector<std::filesystem::path> cameras;  ///< one per view, or empty
  std::vector<CaseModel> models;
  std::vector<ModelTunnelPlan> tunnels = {};  ///< of the models' plans
  /// Of each view, for a sequence: the image's number is the sequence's frame plus this; empty: 0.
  std::vector<int> frame_offsets = {};
};

/// Whether a case's file names models to be registered: "models" that is not empty, in whatever form, so that
/// a wrong one is refused where it is read.
bool has_models(const std::filesystem::path& path);

/// Reads a case with "models". Fails as `read_case`.
Expected<RegistrationCase> read_registration_case(const std::filesystem::path& path);

/// Reads a case that is measured by its calibrator, and its models if it names any. Fails as `read_case`.
Expected<RegistrationCase> read_measured_case(const std::filesystem::path& path);

/// An element of "models"; its files relative to `folder`.
Json to_json(const CaseModel& model, const std::filesystem::path& folder);

/// Whether an image's name holds {frame}.
bool is_sequence(const RegistrationCase& given);

/// The case with the images of one frame: in an image's name {frame} or, with leading zeros, {frame:03d} is
/// replaced by the number, to which the view's `frame_offset` is added; an image without it is a file with
/// several frames, the first of which is 1. Fails with bad_value for another form of {frame}.
Expected<RegistrationCase> at_frame(RegistrationCase given, int frame);

}  // namespace helicarm::pipeline
