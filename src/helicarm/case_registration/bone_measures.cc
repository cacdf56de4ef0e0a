// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/bone_measures.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/measures/measure.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::RigidTransform;
using measures::InBone;
using measures::Landmark;
using measures::LandmarkSet;

constexpr Range world_mm{-1e6, 1e6};

const PosedModel* posed_model(const BoneScene& scene, const std::string& name) {
  const auto found = std::ranges::find(scene.models, name, &PosedModel::name);
  return found == scene.models.end() ? nullptr : &*found;
}

/// How far two poses of a camera are apart.
struct Apart {
  double mm, deg;
  /// Of one acquisition; another prior moves the camera a little.
  bool is_same() const { return mm <= 5 && deg <= 1; }
};

/// Nothing where the file does not state the camera of this name.
std::optional<Apart> from_registered(const PosedModel& model, const SceneView& view) {
  const auto registered = model.cameras.find(view.name);
  if (registered == model.cameras.end()) return std::nullopt;
  const RigidTransform now = view.view.camera_from_world.inverse(), then = registered->second.inverse();
  return Apart{(now.translation - then.translation).norm(),
               Eigen::AngleAxisd(now.rotation.transpose() * then.rotation).angle() * 180 / double(EIGEN_PI)};
}

/// Whether the views are of another moment than the registration.
bool are_other_images(const PosedModel& model, std::span<const SceneView> views) {
  if (model.cameras.empty() || views.empty()) return false;
  bool has_common = false;
  for (const SceneView& view : views)
    if (const auto apart = from_registered(model, view)) {
      if (!apart->is_same()) return true;
      has_common = true;
    }
  return !has_common;
}

bool has_moved(const PosedModel& model) {
  return std::ranges::any_of(model.at_acquisitions, [&](const auto& at) {
    return !at.second.matrix().isApprox(model.world_from_model.matrix(), 1e-9);
  });
}

/// world_from_model at the view's acquisition.
RigidTransform pose_at(const PosedModel& model, const SceneView& view) {
  if (model.bone)
    if (const auto bone = view.world_from_bone.find(model.bone->name); bone != view.world_from_bone.end())
      return bone->second * model.bone->bone_from_model;
  const auto apart = from_registered(model, view);
  if (apart && !apart->is_same())
    throw BadInput(
        Reason::bad_value,
        fmt::format("view \"{}\": its camera is {:.1f} mm and {:.1f} degrees from that of the registration: "
                    "they are of other images; register and calibrate the same, or give both cases the poses "
                    "of the marker on the bone (\"moves_with\" of \"{}\")",
                    view.name, apart->mm, apart->deg, model.name));
  const auto then = model.at_acquisitions.find(view.name);
  if (then != model.at_acquisitions.end()) return then->second;
  if (model.bone || has_moved(model))
    throw BadInput(
        Reason::bad_value,
        fmt::format("view \"{}\": \"{}\" moves with a bone's marker and was not registered in this "
                    "view, and the calibration's result has no pose of that marker then: give its "
                    "case the bone's \"poses\", or register the model in these images",
                    view.name, model.name));
  return model.world_from_model;
}

/// Nothing for a point that is neither planned nor located.
std::optional<Landmark> found_by_name(const std::string& name, const PosedModel& model,
                                      const WorldPoints& located) {
  if (const auto planned = model.planned.find(name); planned != model.planned.end())
    return Landmark{name, planned->second, Matrix3d::Zero()};
  if (const auto point = located.find(name); point != located.end())
    return in_model(name, point->second, model);
  return std::nullopt;
}

std::vector<Landmark> landmarks_of(const LandmarkSet& set, const BoneScene& scene) {
  const PosedModel* model = posed_model(scene, set.model);
  std::vector<Landmark> landmarks;
  for (const measures::TableLandmark& each : set.landmarks) {
    if (each.landmark) {
      landmarks.push_back(*each.landmark);
      continue;
    }
    if (model == nullptr)
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: model: \"{}\" is no registered model of --registration", each.row, set.model));
    auto found = found_by_name(each.name, *model, scene.located);
    if (!found)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\" has no coordinates, and is neither a point of the model's plan "
                                 "in --registration nor a located one of --calibration",
                                 each.row, each.name));
    if (!model->planned.contains(each.name) && are_other_images(*model, scene.views))
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"{}\" was located in other images than \"{}\" was registered in: register "
                      "the model there too, its \"measures\" then hold the point",
                      each.row, each.name, set.model));
    landmarks.push_back(*std::move(found));
  }
  return landmarks;
}

RigidTransform pose_in(JsonReader& reader, const char* key) {
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix4d>(reader.matrix(key, 4, 4, world_mm).data()).transpose();
  return value_or_throw(geometry::rigid_transform_from(matrix, reader.where() + ": " + key));
}

PosedModel posed(const RegisteredModel& model) {
  const registration::Registration& found = model.registration;
  PosedModel made{found.name,   found.world_from_model, found.covariance,
                  found.centre, found.scale_sigma,      found.by_scale};
  for (const RegisteredPoint& point : model.points)
    made.planned[point.name] = found.world_from_model.inverse() * point.place.in_calibrator;
  return made;
}

/// The picks of a view and, where a point is not picked, its image; nothing unless all landmarks are picked.
std::optional<std::vector<measures::Click>> clicks_in(std::size_t view, std::span<const Landmark> landmarks,
                                                      const pipeline::Case& the_case,
                                                      const LoadedViews& loaded, const RegisteredModel& model,
                                                      measures::Kind kind) {
  std::vector<measures::Click> clicks;
  const auto roles = measures::info_of(kind).roles;
  for (const Landmark& each : landmarks) {
    if (each.name == measures::axis_medial || each.name == measures::axis_lateral) continue;
    const auto pick = std::ranges::find_if(the_case.picks, [&](const pipeline::Pick& one) {
      return one.name == each.name && one.view == loaded.views[view].name;
    });
    if (pick == the_case.picks.end()) {
      if (std::ranges::find(roles, each.name, &measures::Role::word) != roles.end()) return std::nullopt;
      const RigidTransform& pose = model.registration.world_from_model;
      auto image = measures::click_of(each.name, pose * each.at,
                                      pose.rotation * each.covariance_mm2 * pose.rotation.transpose(),
                                      model.views[view]);
      if (!image) return std::nullopt;
      clicks.push_back(*std::move(image));
      continue;
    }
    const auto at = loaded.maps[view] ? rectification::rectified_in_image(*loaded.maps[view], pick->uv_raw)
                                      : std::optional(pick->uv_raw);
    if (!at) return std::nullopt;
    const double sigma_px = pick->sigma_px.value_or(fiducials::click_sigma_px);
    clicks.push_back({each.name, *at, sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  }
  return clicks;
}

std::vector<measures::InImage> clicked_in(std::span<const Landmark> landmarks, measures::Kind kind,
                                          const pipeline::Case& the_case, const LoadedViews& loaded,
                                          const RegisteredModel& model) {
  std::vector<measures::InImage> images;
  for (std::size_t view = 0; view < std::min(loaded.views.size(), model.views.size()); ++view)
    if (const auto clicks = clicks_in(view, landmarks, the_case, loaded, model, kind))
      if (auto measure = measures::measure(kind, *clicks, {}); measure && !measure->positions.empty())
        images.push_back({loaded.views[view].name, std::move(measure->positions)});
  return images;
}

bool is_picked(const pipeline::Case& the_case, const std::string& name) {
  return std::ranges::find(the_case.picks, name, &pipeline::Pick::name) != the_case.picks.end();
}

bool is_planned(const std::optional<MarkupPlan>& plan, const std::string& name) {
  return plan && std::ranges::find(plan->points, name, &PlanPoint::name) != plan->points.end();
}

/// What can be said before the registration: names, and landmarks that determine no measure.
void check_set(const LandmarkSet& set, const pipeline::Case& the_case,
               const std::optional<MarkupPlan>& plan) {
  std::vector<Landmark> landmarks;
  bool is_whole = true;
  for (const measures::TableLandmark& each : set.landmarks) {
    if (each.landmark) {
      landmarks.push_back(*each.landmark);
      continue;
    }
    if (!is_planned(plan, each.name) && !is_picked(the_case, each.name))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\" has no coordinates, and is neither a point of the model's plan "
                                 "nor a pick",
                                 each.row, each.name));
    const auto roles = measures::info_of(set.kind).roles;
    is_whole = is_whole && each.name != measures::axis_medial && each.name != measures::axis_lateral &&
               std::ranges::find(roles, each.name, &measures::Role::word) == roles.end();
  }
  if (is_whole) value_or_throw(measures::measure_in_bone(set.name, set.model, set.kind, landmarks, {}));
}

}  // namespace

std::vector<SceneView> views_of(const calibration::SavedCalibration& calibration) {
  std::vector<SceneView> views;
  for (std::size_t i = 0; i < calibration.views.size(); ++i)
    views.push_back({{calibration.views[i].name, calibration.views[i].view}, calibration.bones_in(i)});
  return views;
}

Expected<geometry::View> view_of_model(const PosedModel& model, const SceneView& view) {
  return guarded([&] {
    geometry::View moved = view.view;
    const RigidTransform pose = pose_at(model, view);
    if (pose.matrix() != model.world_from_model.matrix())
      moved.camera_from_world = moved.camera_from_world * pose * model.world_from_model.inverse();
    return moved;
  });
}

Expected<std::vector<PosedModel>> posed_models_from(const Json& registration, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(registration, origin);
    std::map<std::string, RigidTransform> cameras;
    for (JsonReader& view : reader.objects("views", false))
      if (view.has("camera_from_world")) cameras[view.text("name")] = pose_in(view, "camera_from_world");
    std::vector<PosedModel> models;
    for (JsonReader& model : reader.objects("models", true)) {
      if (model.text("decision") == "refuse" || !model.has("world_from_model")) continue;
      PosedModel posed{model.text("name"), pose_in(model, "world_from_model"),
                       Eigen::Map<const registration::RigidCovariance>(
                           model.matrix("covariance", 6, 6, {-1e12, 1e12}).data()),
                       Vector3d(model.numbers("centre_mm", 3, world_mm).data())};
      posed.scale_sigma = model.optional_number("scale_sigma", {0, 1}).value_or(0);
      if (model.has("by_scale"))
        posed.by_scale =
            Eigen::Map<const registration::RigidStep>(model.numbers("by_scale", 6, {-1e6, 1e6}).data());
      for (JsonReader& point : model.objects("points", false))
        posed.planned[point.text("name")] =
            posed.world_from_model.inverse() * Vector3d(point.numbers("xyz_mm", 3, world_mm).data());
      for (JsonReader& view : model.objects("acquisitions", false))
        posed.at_acquisitions[view.text("view")] = pose_in(view, "world_from_model");
      if (model.has("moves_with") && model.has("bone_from_model"))
        posed.bone = {model.text("moves_with"), pose_in(model, "bone_from_model")};
      posed.cameras = cameras;
      models.push_back(std::move(posed));
    }
    return models;
  });
}

Expected<WorldPoints> located_points_from(const Json& result, const std::string& origin) {
  return guarded([&] {
    WorldPoints points;
    for (JsonReader& entry : JsonReader(result, origin).objects("points", false))
      if (entry.has("xyz_mm") && entry.has("covariance_mm2"))
        points[entry.text("name")] = {
            Vector3d(entry.numbers("xyz_mm", 3, world_mm).data()),
            Eigen::Map<const Matrix3d>(entry.matrix("covariance_mm2", 3, 3, world_mm).data())};
    return points;
  });
}

WorldPoints located_points_of(const pipeline::Result& result) {
  WorldPoints points;
  for (const pipeline::PointResult& point : result.points)
    if (point.place && point.place->covariance_in_calibrator.allFinite())
      points[point.name] = {point.place->in_calibrator, point.place->covariance_in_calibrator};
  return points;
}

Landmark in_model(const std::string& name, const WorldPoint& point, const PosedModel& model) {
  const Matrix3d to_model = model.world_from_model.rotation.transpose();
  return {
      name, model.world_from_model.inverse() * point.at,
      to_model *
          (point.covariance_mm2 + registration::point_covariance(model.covariance, model.by_scale,
                                                                 model.scale_sigma, model.centre, point.at)) *
          to_model.transpose()};
}

Expected<InBone> measured_in_bone(const LandmarkSet& set, const BoneScene& scene) {
  return guarded([&] {
    const PosedModel* model = posed_model(scene, set.model);
    std::vector<measures::NamedView> views;
    if (model)
      for (const SceneView& view : scene.views)
        views.push_back({view.name, value_or_throw(view_of_model(*model, view))});
    return value_or_throw(
        measures::measure_in_bone(set.name, set.model, set.kind, landmarks_of(set, scene), scene.zones,
                                  model ? std::optional(model->world_from_model) : std::nullopt, views));
  });
}

std::vector<ModelMeasures> read_measures(const pipeline::Case& the_case,
                                         std::span<const std::optional<MarkupPlan>> plans) {
  std::vector<ModelMeasures> all;
  for (std::size_t i = 0; i < the_case.models.size(); ++i) {
    const pipeline::CaseModel& model = the_case.models[i];
    ModelMeasures& of_model = all.emplace_back();
    if (!model.measures) continue;
    of_model.zones = value_or_throw(measures::zones_of(model.zones));
    for (LandmarkSet& set : value_or_throw(measures::read_landmark_table(*model.measures))) {
      if (set.model != model.name) continue;
      check_set(set, the_case, plans[i]);
      of_model.sets.push_back(std::move(set));
    }
    if (of_model.sets.empty())
      throw BadInput(Reason::bad_value, fmt::format("models: \"{}\": {} has no row with this model",
                                                    model.name, model.measures->filename().string()));
  }
  return all;
}

std::vector<InBone> measures_of(const ModelMeasures& wanted, const WorldPoints& located,
                                const pipeline::Case& the_case, const LoadedViews& loaded,
                                RegisteredModel& model) {
  if (model.registration.failure || !model.registration.is_determined()) return {};
  BoneScene scene{{posed(model)}, located, {}, wanted.zones};
  for (std::size_t i = 0; i < std::min(loaded.views.size(), model.views.size()); ++i)
    scene.views.push_back({{loaded.views[i].name, model.views[i]}});
  std::vector<InBone> found;
  for (LandmarkSet set : wanted.sets) {
    std::vector<std::string> missing;
    std::erase_if(set.landmarks, [&](const measures::TableLandmark& each) {
      if (each.landmark || found_by_name(each.name, scene.models.front(), located)) return false;
      missing.push_back(each.name);
      return true;
    });
    auto measure = measured_in_bone(set, scene);
    if (!measure) {
      const Failure& failure = measure.error();
      model.registration.notes.push_back({failure.reason, failure.message, {}, failure.figures});
      continue;
    }
    measure->missing = std::move(missing);
    measure->clicked = clicked_in(landmarks_of(set, scene), measure->measure.kind, the_case, loaded, model);
    found.push_back(*std::move(measure));
  }
  return found;
}

}  // namespace helicarm::case_registration
