// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/calibrator.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/phantom/ball_covariance.h"
#include "helicarm/phantom/calibrator_limits.h"
#include "helicarm/phantom/conical_helix.h"

namespace helicarm::phantom {
namespace {

constexpr std::size_t least_balls = 6;
constexpr std::size_t most_balls = 1000;
constexpr double least_flatness = 0.01;

Eigen::Vector3d vector3(const std::vector<double>& values, std::size_t first = 0) {
  return {values[first], values[first + 1], values[first + 2]};
}

std::string name_of(JsonReader& reader, const char* key) {
  std::string name = reader.text(key);
  if (name.empty()) reader.refuse(Reason::bad_value, key, "is empty");
  return name;
}

CalibratorBall ball_from(JsonReader reader) {
  CalibratorBall ball{name_of(reader, "label"), vector3(reader.numbers("xyz_mm", 3, coordinate_range)),
                      reader.number("diameter_mm", diameter_range)};
  if (!reader.raw("covariance_mm2").is_null())
    ball.covariance_mm2 = covariance_from(reader, "covariance_mm2", 3);
  reader.finish();
  return ball;
}

std::vector<Eigen::Vector3d> directions_from(JsonReader& reader, std::size_t count) {
  const auto values = reader.matrix("directions", count, 3, {-2, 2});
  std::vector<Eigen::Vector3d> directions;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d direction = vector3(values, 3 * i);
    if (std::abs(direction.norm() - 1) > 1e-3)
      reader.refuse(Reason::bad_value, "directions",
                    fmt::format("direction {1} has length {0}, must be a unit vector (1 within 0.001)",
                                direction.norm(), i + 1));
    directions.push_back(direction.normalized());
  }
  return directions;
}

CalibratorTarget target_from(JsonReader reader) {
  CalibratorTarget target;
  target.name = name_of(reader, "name");
  target.point_in_calibrator = vector3(reader.numbers("xyz_mm", 3, coordinate_range));
  target.kind = static_cast<TargetKind>(reader.choice("kind", {"ball", "cross", "line_end"}));
  target.diameter_mm = reader.number("diameter_mm", diameter_range);
  target.length_mm = reader.optional_number("length_mm", {0.1, 1000}).value_or(0);
  if (target.kind == TargetKind::cross) {
    target.directions = directions_from(reader, 2);
    if (target.directions[0].cross(target.directions[1]).norm() < 0.01)
      reader.refuse(Reason::bad_value, "directions", "the two wires are parallel");
  } else if (target.kind == TargetKind::line_end) {
    target.directions = directions_from(reader, 1);
  } else if (const Json& directions = reader.raw("directions");
             !directions.is_null() && !directions.empty()) {
    reader.refuse(Reason::bad_value, "directions", "a ball has none");
  }
  reader.finish();
  return target;
}

void check_names(const Calibrator& calibrator, const std::string& origin) {
  std::set<std::string> names;
  const auto take = [&](const std::string& name) {
    if (!names.insert(name).second)
      throw BadInput(Reason::name_clash, fmt::format("{}: the name \"{}\" is given twice", origin, name));
  };
  for (const auto& ball : calibrator.balls) take(ball.label);
  for (const auto& target : calibrator.targets) take(target.name);
}

void check_distances(const std::vector<CalibratorBall>& balls, const std::string& origin) {
  for (std::size_t i = 0; i < balls.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = (balls[i].centre_in_calibrator - balls[j].centre_in_calibrator).norm();
      if (distance < least_distance_mm)
        throw BadInput({Reason::bad_value,
                        fmt::format("{}: balls {} and {} are {:.3g} mm apart, at least {:g} mm are required",
                                    origin, balls[j].label, balls[i].label, distance, least_distance_mm),
                        {},
                        {{"value", distance}, {"limit", least_distance_mm}}});
    }
}

void check_places(const std::vector<CalibratorBall>& balls, const std::string& origin) {
  if (balls.size() < least_balls)
    throw BadInput(Reason::bad_value, fmt::format("{}: \"balls\": {} balls, at least {} are required", origin,
                                                  balls.size(), least_balls));
  Eigen::Matrix3Xd centres(3, balls.size());
  for (std::size_t i = 0; i < balls.size(); ++i)
    centres.col(static_cast<Eigen::Index>(i)) = balls[i].centre_in_calibrator;
  const double extent = (centres.rowwise().maxCoeff() - centres.rowwise().minCoeff()).maxCoeff();
  if (extent < least_extent_mm)
    throw BadInput({Reason::bad_value,
                    fmt::format("{}: \"balls\": they extend over {:.3g} mm, at least {:g} mm are required; "
                                "check the unit (metres?)",
                                origin, extent, least_extent_mm),
                    {},
                    {{"value", extent}, {"limit", least_extent_mm}}});
  check_distances(balls, origin);
  const Eigen::Matrix3Xd spread = centres.colwise() - centres.rowwise().mean();
  const Eigen::Vector3d variances =
      geometry::symmetric_eigen(spread * spread.transpose() / double(balls.size())).values;
  const Eigen::Vector3d sizes = variances.cwiseMax(0).cwiseSqrt().reverse();
  if (sizes[2] < least_flatness * sizes[0])
    throw BadInput(
        {Reason::coplanar_fiducials,
         fmt::format(
             "{}: the balls' distance from one plane is {:.3g} mm rms, at least {:.3g} mm are required",
             origin, sizes[2], least_flatness * sizes[0]),
         {},
         {{"plane_rms_mm", sizes[2]}, {"limit_mm", least_flatness * sizes[0]}}});
}

Json numbers(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

}  // namespace

Calibrator udcsc() {
  Calibrator calibrator{"udcsc", {}, {}};
  for (int k = 0; k < 12; ++k)
    calibrator.balls.push_back(
        {fmt::format("P{}", k + 1), ConicalHelix().point(std::numbers::pi * (1.0 / 6 + k / 2.0)), 4.0});
  return calibrator;
}

Expected<Calibrator> calibrator_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    Calibrator calibrator;
    calibrator.name = name_of(reader, "name");
    for (JsonReader& ball : reader.objects("balls", true, most_balls))
      calibrator.balls.push_back(ball_from(ball));
    for (JsonReader& target : reader.objects("targets", false, most_balls))
      calibrator.targets.push_back(target_from(target));
    if (!reader.raw("joint_covariance").is_null())
      calibrator.joint_covariance =
          joint_covariance_from(reader.object("joint_covariance"), calibrator.balls);
    calibrator.tolerance_mm = reader.optional_number("tolerance_mm", tolerance_range).value_or(0);
    calibrator.scale_sigma = reader.optional_number("scale_sigma", scale_sigma_range).value_or(0);
    calibrator.measured = reader.raw("measured");
    if (!calibrator.measured.is_null() && !calibrator.measured.is_object())
      reader.refuse(Reason::bad_value, "measured", "is not an object");
    reader.finish();
    check_names(calibrator, origin);
    check_places(calibrator.balls, origin);
    return calibrator;
  });
}

Expected<Calibrator> read_calibrator(const std::filesystem::path& path) {
  return read_json(path).and_then(
      [&](const Json& json) { return calibrator_from_json(json, path.filename().string()); });
}

Expected<Calibrator> calibrator_named(const std::string& name_or_path, const std::filesystem::path& folder) {
  if (Calibrator built_in = udcsc(); name_or_path == built_in.name) return built_in;
  return path_inside(folder, name_or_path).and_then(read_calibrator).map_error([](Failure failure) {
    if (failure.reason == Reason::missing_file)
      failure.message += fmt::format("; the built-in calibrator is \"{}\"", udcsc().name);
    return failure;
  });
}

Json to_json(const Calibrator& calibrator) {
  constexpr const char* kinds[] = {"ball", "cross", "line_end"};
  Json json{{"name", calibrator.name}, {"balls", Json::array()}, {"targets", Json::array()}};
  if (calibrator.tolerance_mm > 0) json["tolerance_mm"] = calibrator.tolerance_mm;
  if (calibrator.scale_sigma > 0) json["scale_sigma"] = calibrator.scale_sigma;
  if (!calibrator.measured.is_null()) json["measured"] = calibrator.measured;
  if (calibrator.joint_covariance) json["joint_covariance"] = to_json(*calibrator.joint_covariance);
  for (const auto& ball : calibrator.balls) {
    Json entry{{"label", ball.label},
               {"xyz_mm", numbers(ball.centre_in_calibrator)},
               {"diameter_mm", ball.diameter_mm}};
    if (ball.covariance_mm2)
      for (const auto& row : ball.covariance_mm2->rowwise())
        entry["covariance_mm2"].push_back(numbers(row.transpose()));
    json["balls"].push_back(std::move(entry));
  }
  for (const auto& target : calibrator.targets) {
    Json entry{{"name", target.name},
               {"xyz_mm", numbers(target.point_in_calibrator)},
               {"kind", kinds[static_cast<int>(target.kind)]},
               {"diameter_mm", target.diameter_mm}};
    for (const auto& direction : target.directions) entry["directions"].push_back(numbers(direction));
    if (target.length_mm > 0) entry["length_mm"] = target.length_mm;
    json["targets"].push_back(std::move(entry));
  }
  return json;
}

Eigen::Vector3d middle_of(const Calibrator& calibrator) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const CalibratorBall& ball : calibrator.balls) sum += ball.centre_in_calibrator;
  return sum / double(calibrator.balls.size());
}

bool same_places(const Calibrator& a, const Calibrator& b) {
  std::map<std::string, Eigen::Vector3d> places;
  for (const auto& ball : b.balls) places[ball.label] = ball.centre_in_calibrator;
  return a.balls.size() == b.balls.size() &&
         std::all_of(a.balls.begin(), a.balls.end(), [&](const CalibratorBall& ball) {
           const auto found = places.find(ball.label);
           return found != places.end() && (found->second - ball.centre_in_calibrator).norm() < 0.01;
         });
}

}  // namespace helicarm::phantom
