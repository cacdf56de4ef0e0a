// SPDX-License-Identifier: Apache-2.0
#include "measure_landmarks.h"

#include <algorithm>
#include <map>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/core/csv.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/measures/in_space.h"
#include "helicarm/measures/measure_json.h"
#include "helicarm/measures/zones.h"
#include "helicarm/registration/motion.h"

namespace helicarm::cli {
namespace in_space {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::RigidTransform;

constexpr Range coordinates{-1e6, 1e6};
/// A view that is meant as lateral; others are not told of.
constexpr double nearly_lateral_deg = 30;
/// Condyles 50 mm apart are then 6 degrees off: a tenth of the condyles' depth.
constexpr double most_apart_mm = 5;

struct Point {
  Vector3d in_world;
  Matrix3d covariance_mm2;
  bool is_planned = false;  ///< in the model itself, exactly
};

/// A registered model.
struct Pose {
  RigidTransform world_from_model;
  registration::RigidCovariance covariance;
  Vector3d centre;
  std::map<std::string, Point> points = {};
};

std::map<std::string, Point> points_in(std::vector<JsonReader> entries, bool are_planned) {
  std::map<std::string, Point> points;
  for (JsonReader& entry : entries)
    if (entry.has("xyz_mm") && entry.has("covariance_mm2"))
      points[entry.text("name")] = {
          Vector3d(entry.numbers("xyz_mm", 3, coordinates).data()),
          Eigen::Map<const Matrix3d>(entry.matrix("covariance_mm2", 3, 3, coordinates).data()), are_planned};
  return points;
}

/// The models that were not refused.
std::map<std::string, Pose> poses_in(const std::filesystem::path& path) {
  const Json json = value_or_throw(read_json(path));
  JsonReader reader(json, path.filename().string());
  std::map<std::string, Pose> poses;
  for (JsonReader& model : reader.objects("models", true)) {
    if (model.text("decision") == "refuse" || !model.has("world_from_model")) continue;
    const Eigen::Matrix4d matrix =
        Eigen::Map<const Eigen::Matrix4d>(model.matrix("world_from_model", 4, 4, coordinates).data())
            .transpose();
    Pose pose{{matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()},
              Eigen::Map<const registration::RigidCovariance>(
                  model.matrix("covariance", 6, 6, {-1e12, 1e12}).data()),
              Vector3d(model.numbers("centre_mm", 3, coordinates).data())};
    pose.points = points_in(model.objects("points", false), true);
    poses[model.text("name")] = std::move(pose);
  }
  return poses;
}

struct Scene {
  std::map<std::string, Pose> models;
  std::optional<calibration::SavedCalibration> calibration;
  std::map<std::string, Point> located;
};

Scene scene_of(const MeasureArguments& arguments) {
  Scene scene;
  if (arguments.registration) scene.models = poses_in(*arguments.registration);
  if (!arguments.calibration) return scene;
  const std::string origin = arguments.calibration->filename().string();
  const Json json = value_or_throw(read_json(*arguments.calibration));
  scene.calibration = value_or_throw(calibration::saved_calibration_from_json(json, origin));
  scene.located = points_in(JsonReader(json, origin).objects("points", false), false);
  return scene;
}

const Pose& pose_of(const Scene& scene, const std::string& model, const std::string& where) {
  const auto found = scene.models.find(model);
  if (found == scene.models.end())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: model: \"{}\" is no registered model of --registration", where, model));
  return found->second;
}

/// A point of the world in the model, with the errors of both.
measures::Landmark in_model(const std::string& name, const Point& point, const Pose& pose) {
  const Matrix3d to_model = pose.world_from_model.rotation.transpose();
  Matrix3d covariance = Matrix3d::Zero();
  if (!point.is_planned)
    covariance = to_model *
                 (point.covariance_mm2 +
                  registration::point_covariance(pose.covariance, pose.centre, point.in_world)) *
                 to_model.transpose();
  return {name, pose.world_from_model.inverse() * point.in_world, covariance};
}

/// The measures of the table, in the order of first occurrence.
struct Wanted {
  std::string name, model;
  measures::Kind kind;
  std::vector<measures::Landmark> landmarks = {};
};

measures::Landmark landmark_from(const CsvTable& table, std::size_t row, const Scene& scene) {
  const std::string where = fmt::format("landmarks: row {}", row + 1);
  const std::string& name = table.text(row, "name");
  const auto x = table.optional_number(row, "x_mm"), y = table.optional_number(row, "y_mm"),
             z = table.optional_number(row, "z_mm");
  const double sigma = table.optional_number(row, "sigma_mm").value_or(0);
  if (sigma < 0) throw BadInput(Reason::bad_value, fmt::format("{}: sigma_mm: is negative", where));
  if (x && y && z) return {name, {*x, *y, *z}, sigma * sigma * Matrix3d::Identity()};
  if (x || y || z)
    throw BadInput(Reason::bad_value, fmt::format("{}: x_mm, y_mm, z_mm: all three or none", where));
  const Pose& pose = pose_of(scene, table.text(row, "model"), where);
  if (const auto planned = pose.points.find(name); planned != pose.points.end())
    return in_model(name, planned->second, pose);
  if (const auto located = scene.located.find(name); located != scene.located.end())
    return in_model(name, located->second, pose);
  throw BadInput(Reason::bad_value,
                 fmt::format("{}: \"{}\" has no coordinates, and is neither a point of the model's plan in "
                             "--registration nor a located one of --calibration",
                             where, name));
}

std::vector<Wanted> wanted_measures(const CsvTable& table, const Scene& scene) {
  std::vector<Wanted> all;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string &name = table.text(row, "measure"), &model = table.text(row, "model");
    const auto kind = measures::kind_named(table.text(row, "kind"));
    if (!kind)
      throw BadInput(Reason::bad_value, fmt::format("landmarks: row {}: kind: \"{}\" is none of: "
                                                    "femoral_quadrants, tibia_ap, tibia_ml",
                                                    row + 1, table.text(row, "kind")));
    auto wanted = std::ranges::find(all, name, &Wanted::name);
    if (wanted == all.end()) wanted = all.insert(all.end(), {name, model, *kind});
    if (wanted->kind != *kind || wanted->model != model)
      throw BadInput(
          Reason::bad_value,
          fmt::format("landmarks: row {}: measure \"{}\" has another kind or model before", row + 1, name));
    wanted->landmarks.push_back(landmark_from(table, row, scene));
  }
  return all;
}

/// A view beside the true lateral one of a registered bone.
struct LateralView {
  std::string view;
  measures::Lateral lateral;
  bool is_off = false;
};

std::vector<LateralView> laterals_of(const Wanted& wanted, const Scene& scene) {
  const auto at = [&](std::string_view name) {
    const auto found = std::ranges::find(wanted.landmarks, name, &measures::Landmark::name);
    return found == wanted.landmarks.end() ? std::nullopt : std::optional(found->at);
  };
  const auto medial = at(measures::axis_medial), lateral = at(measures::axis_lateral);
  const auto model = scene.models.find(wanted.model);
  std::vector<LateralView> views;
  if (!scene.calibration || model == scene.models.end() || !medial || !lateral) return views;
  const RigidTransform& pose = model->second.world_from_model;
  for (const calibration::CalibratedView& view : scene.calibration->views) {
    const auto found = measures::lateral_of(view.view, pose * *medial, pose * *lateral);
    if (found && found->off_deg <= nearly_lateral_deg)
      views.push_back({view.name, *found, found->apart_mm > most_apart_mm});
  }
  return views;
}

std::string sentence_of(const LateralView& view) {
  return fmt::format("{}: {:.1f} degrees off a true lateral image, the axis' ends {:.1f} mm apart{}",
                     view.view, view.lateral.off_deg, view.lateral.apart_mm,
                     view.is_off ? fmt::format(": over {:g} mm: this image is no lateral one, and per cent "
                                               "clicked in it are of another projection",
                                               most_apart_mm)
                                 : "");
}

Json to_json(const LateralView& view) {
  return {{"view", view.view},
          {"off_deg", view.lateral.off_deg},
          {"apart_mm", view.lateral.apart_mm},
          {"is_lateral", !view.is_off}};
}

std::vector<measures::Zone> zones_of(const MeasureArguments& arguments) {
  if (arguments.zones) {
    const Json json = value_or_throw(read_json(*arguments.zones));
    return value_or_throw(measures::zones_from(json, arguments.zones->filename().string()));
  }
  return value_or_throw(
      measures::zones_from(value_or_throw(parse_json(measures::usual_zones_text(), "zones")), "zones"));
}

Json answer_of(const Wanted& wanted, const measures::Measure& measure, const Scene& scene,
               std::span<const measures::Zone> zones) {
  Json answer{{"name", wanted.name}, {"model", wanted.model}, {"view", nullptr}};
  answer.update(measures::to_json(measure));
  for (std::size_t i = 0; i < measure.positions.size(); ++i) {
    Json fits = Json::array(), warnings = Json::array();
    for (const measures::ZoneFit& fit : measures::zone_fits(measure.kind, measure.positions[i], zones))
      fits.push_back(measures::to_json(fit, measure.kind));
    for (const Warning& warning : measure.positions[i].warnings)
      warnings.push_back({{"code", code(warning.reason)}, {"message", warning.message}});
    answer["positions"][i]["zones"] = std::move(fits);
    answer["positions"][i]["warnings"] = std::move(warnings);
  }
  answer["laterals"] = Json::array();
  for (const LateralView& view : laterals_of(wanted, scene)) answer["laterals"].push_back(to_json(view));
  return answer;
}

void print(const Wanted& wanted, const measures::Measure& measure, const Scene& scene,
           std::span<const measures::Zone> zones, std::ostream& out) {
  out << fmt::format("{} ({}, in space{})\n", wanted.name, measures::info_of(measure.kind).label,
                     wanted.model.empty() ? "" : ", " + wanted.model);
  for (const measures::Quantity& quantity : measure.quantities)
    out << "  " << measures::sentence_of(quantity) << '\n';
  for (const measures::Position& position : measure.positions) {
    out << "  " << measures::sentence_of(measure.kind, position) << '\n';
    for (const measures::ZoneFit& fit : measures::zone_fits(measure.kind, position, zones))
      out << "    " << measures::sentence_of(fit, measure.kind) << '\n';
    for (const Warning& warning : position.warnings) out << "  warning: " << warning.message << '\n';
  }
  for (const LateralView& view : laterals_of(wanted, scene))
    out << (view.is_off ? "  warning: " : "  ") << sentence_of(view) << '\n';
}

void answer(const MeasureArguments& arguments, Console& console) {
  const Scene scene = scene_of(arguments);
  const std::vector<measures::Zone> zones = zones_of(arguments);
  const auto table = value_or_throw(read_csv(
      *arguments.landmarks, {"measure", "kind", "model", "name", "x_mm", "y_mm", "z_mm"}, {"sigma_mm"}));
  Json all = Json::array();
  for (const Wanted& wanted : wanted_measures(table, scene)) {
    auto measure = measures::measure_in_space(wanted.kind, wanted.landmarks);
    if (!measure) {
      Failure failure = std::move(measure).error();
      failure.message = fmt::format("measure \"{}\": {}", wanted.name, failure.message);
      throw BadInput(std::move(failure));
    }
    if (console.json)
      all.push_back(answer_of(wanted, *measure, scene, zones));
    else
      print(wanted, *measure, scene, zones, console.out);
  }
  if (console.json) console.out << to_text({{"measures", std::move(all)}, {"notes", Json::array()}}) << '\n';
}

}  // namespace
}  // namespace in_space

void measure_landmarks(const MeasureArguments& arguments, Console& console) {
  in_space::answer(arguments, console);
}

}  // namespace helicarm::cli
