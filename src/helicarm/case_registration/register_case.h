// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/bone_measures.h"
#include "helicarm/case_registration/load.h"
#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/progress.h"
#include "helicarm/core/json.h"
#include "helicarm/guidance/guide.h"
#include "helicarm/guidance/tunnel.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/registration/landmarks.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::case_registration {

/// Searched about each start of a model.
struct SearchRange {
  double shift_mm = 15;
  double turn_deg = 15;

  bool operator==(const SearchRange&) const = default;
};

struct RegisterOptions {
  /// Of the calibration and the limits, as for a run. `max_error_mm` also holds for the models and their
  /// plans, `motion_sigma_mm` for models that are not tracked.
  pipeline::RunOptions run = {};
  SearchRange search = {};
};

/// A point of a plan carried to the world, bones and tool.
struct RegisteredPoint {
  std::string name;
  guidance::PointInFrames place;
};

struct RegisteredModel {
  registration::Registration registration;
  std::shared_ptr<const registration::Model> model;             ///< as read; null: by landmarks only
  std::optional<registration::LandmarkRegistration> landmarks;  ///< of the start, or the result itself
  std::vector<registration::Landmark> used_landmarks;
  bool by_landmarks_only = false;
  bool is_surface = false;
  std::optional<guidance::Bone> moves_with;
  /// `moves_with` at the first acquisition, if its marker was read at all of them.
  std::optional<geometry::RigidTransform> world_from_bone = {};
  std::vector<RegisteredPoint> points;
  std::vector<guidance::Tunnel> tunnels;
  std::vector<pipeline::TunnelEnds> tunnel_ends;  ///< of each tunnel, among the points
  /// Of each tunnel; nothing: the model has no outline.
  std::vector<std::optional<registration::BoneCheck>> bone_checks = {};
  std::vector<std::optional<TunnelSlices>> tunnel_slices = {};  ///< in the model's files
  std::vector<measures::InBone> measures = {};                  ///< of the model's table of landmarks
  std::vector<geometry::View> views;  ///< as used: of a tracked bone at the first acquisition
  /// For overlays, per view: outlines of the model at its pose, rectified px.
  std::vector<std::vector<Eigen::Vector2d>> outlines;
  /// The same for each of the registration's alternatives if it is refused: poses to choose from.
  std::vector<std::vector<std::vector<Eigen::Vector2d>>> alternative_outlines = {};
  /// For the report, per view: `drr_image` of the model at its pose.
  std::vector<image::Image<std::uint8_t>> drrs;
};

struct CaseRegistration {
  std::optional<Failure> failure;  ///< of the whole: the views are refused
  std::vector<Warning> warnings;
  std::vector<RegisteredModel> models;
  LoadedViews loaded;
  std::vector<guidance::Bone> bones = {};  ///< of the case

  bool refused() const;
};

/// Outlines of a model over each view at a pose, rectified px.
std::vector<std::vector<Eigen::Vector2d>> outlines(const registration::Model& model,
                                                   const std::vector<geometry::View>& views,
                                                   const geometry::RigidTransform& world_from_model);

/// Registers every model of a case. Unreadable input is a failure; refusals are in the result.
Expected<CaseRegistration> register_case(const pipeline::Case& the_case, const RegisterOptions& options,
                                         const Progress& progress = {});

/// Registers every model to views that are loaded already. `located`: points for the models' measures. Fails
/// as `register_case`.
Expected<CaseRegistration> register_loaded(const pipeline::Case& the_case, LoadedViews loaded,
                                           const RegisterOptions& options, const Progress& progress = {},
                                           const WorldPoints& located = {});

/// registration.json (docs/formats.md).
Json to_json(const CaseRegistration& result);

/// The JSON Schema of registration.json.
Json registration_schema();

/// One HTML file with the overlays inside.
std::string report_html(const CaseRegistration& result);

/// The view's image with the models' outlines and plan points, PNG.
std::string overlay_png(const CaseRegistration& result, std::size_t view);

/// Writes registration.json, report.html and NAME_overlay.png for each view; registration.json last.
Expected<void> write_registration(const CaseRegistration& result, const std::filesystem::path& folder);

}  // namespace helicarm::case_registration
