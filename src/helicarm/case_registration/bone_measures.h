// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/measures/in_bone.h"
#include "helicarm/measures/landmark_table.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/registration/motion.h"

namespace helicarm::pipeline {
struct Result;
}
namespace helicarm::calibration {
struct SavedCalibration;
}

namespace helicarm::case_registration {

struct RegisteredModel;
struct LoadedViews;
struct MarkupPlan;

/// A located point of the world (the calibrator's frame), mm.
struct WorldPoint {
  Eigen::Vector3d at;
  Eigen::Matrix3d covariance_mm2;
};
using WorldPoints = std::map<std::string, WorldPoint>;

/// A bone with a marker that carries a model.
struct CarryingBone {
  guidance::Bone name;
  geometry::RigidTransform bone_from_model;
};

/// A registered model as a measure needs it.
struct PosedModel {
  std::string name;
  geometry::RigidTransform world_from_model;
  registration::RigidCovariance covariance;
  Eigen::Vector3d centre;  ///< of the covariance, in the world
  double scale_sigma = 0;  ///< of the model's size
  /// As in `registration::Registration`; zero of a file of an earlier version: its error of the pose is then
  /// taken for independent of that of the size.
  registration::RigidStep by_scale = registration::RigidStep::Zero();
  std::map<std::string, Eigen::Vector3d> planned = {};  ///< points of its plan, in the model, exact
  /// world_from_model at each view's acquisition, by the view's name; empty: the same in every view.
  std::map<std::string, geometry::RigidTransform> at_acquisitions = {};
  std::optional<CarryingBone> bone = {};  ///< nothing: its marker was not read at every acquisition
  /// camera_from_world of the views that it was registered in; empty: a file of an earlier version.
  std::map<std::string, geometry::RigidTransform> cameras = {};
};

/// A calibrated view with the bones' poses at its acquisition, as far as they were read.
struct SceneView : measures::NamedView {
  std::map<guidance::Bone, geometry::RigidTransform> world_from_bone = {};
};
std::vector<SceneView> views_of(const calibration::SavedCalibration& calibration);

/// The view as if the model were where it was at the registration's first acquisition. In images of another
/// moment than the registration's a model is where its bone's marker was; refuses (bad_value) such a view
/// without that marker.
Expected<geometry::View> view_of_model(const PosedModel& model, const SceneView& view);

/// Of registration.json, without the models that were refused. Fails as JsonReader.
Expected<std::vector<PosedModel>> posed_models_from(const Json& registration, const std::string& origin);
/// Those of result.json that have a position and a covariance. Fails as JsonReader.
Expected<WorldPoints> located_points_from(const Json& result, const std::string& origin);
WorldPoints located_points_of(const pipeline::Result& result);

/// A world point in the model, with the errors of both.
measures::Landmark in_model(const std::string& name, const WorldPoint& point, const PosedModel& model);

/// What a measure in a bone takes its points from.
struct BoneScene {
  std::vector<PosedModel> models;
  WorldPoints located;
  std::vector<SceneView> views;  ///< the located points are at the first one's acquisition
  std::vector<measures::Zone> zones;
};

/// A point without coordinates is one of the model's plan, or a located one carried into the model. Refuses
/// (bad_value) a point that is neither, one that is located in images of another moment than the
/// registration's, a model that is not registered, and as `measure_in_bone` and `view_of_model`. A set whose
/// landmarks all have coordinates needs no model; without one it has no lateral views.
Expected<measures::InBone> measured_in_bone(const measures::LandmarkSet& set, const BoneScene& scene);

/// A model's table of landmarks and zones.
struct ModelMeasures {
  std::vector<measures::LandmarkSet> sets;  ///< of this model
  std::vector<measures::Zone> zones;
};

/// For each model of the case. Throws BadInput: as `read_landmark_table` and `zones_from`, bad_value for a
/// point without coordinates that is neither in the plan nor a pick, and landmarks that determine no measure.
std::vector<ModelMeasures> read_measures(const pipeline::Case& the_case,
                                         std::span<const std::optional<MarkupPlan>> plans);

/// Of a registered model, none if it was refused. Points that were not located are named in `missing`; a set
/// that is not determined is a note of the registration. Where all landmarks of a set are picked in one view,
/// the per cent of that image stand beside.
std::vector<measures::InBone> measures_of(const ModelMeasures& wanted, const WorldPoints& located,
                                          const pipeline::Case& the_case, const LoadedViews& loaded,
                                          RegisteredModel& model);

}  // namespace helicarm::case_registration
