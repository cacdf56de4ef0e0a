// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/calibrator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/codec.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/phantom/ball_covariance.h"
#include "helicarm/phantom/calibrator_limits.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/phantom/schemas.h"

namespace helicarm::phantom {
namespace {

constexpr std::size_t least_balls = 6;
constexpr std::size_t most_balls = 1000;
constexpr double least_flatness = 0.01;
constexpr TextLimits name_limits{1, 200};
constexpr std::array<std::string_view, 3> target_words{"ball", "cross", "line_end"};

Eigen::Vector3d vector3(const std::vector<double>& values, std::size_t first = 0) {
  return {values[first], values[first + 1], values[first + 2]};
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

/// Of a cross two, of a line's end one, of a ball none.
void read_directions(CalibratorTarget& target, JsonReader& reader) {
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

Json rows_of(const auto& vectors) {
  Json rows;
  for (const Eigen::Vector3d& row : vectors) rows.push_back({row.x(), row.y(), row.z()});
  return rows;
}

Json rows_of(const Eigen::Matrix3d& matrix) {
  return rows_of(std::array<Eigen::Vector3d, 3>{matrix.row(0), matrix.row(1), matrix.row(2)});
}

template <class Codec, class Ball>
void describe_ball(Codec& codec, Ball& ball) {
  codec.text("label", ball.label, "unique among fiducials and targets", name_limits);
  codec.vector("xyz_mm", ball.centre_in_calibrator, coordinate_range, "centre");
  codec.number("diameter_mm", ball.diameter_mm, diameter_range, "of the ball");
  codec.custom(
      "covariance_mm2", false,
      {{"type", "array"}, {"minItems", 3}, {"maxItems", 3}, {"items", {{"type", "array"}}}},
      "3x3 covariance of the centre, entries -100 to 100; symmetric, without negative eigenvalues. It "
      "includes the "
      "contribution of `scale_sigma`, `scale_sigma`² (x - c)(x - c)ᵀ about the centroid c of all balls, "
      "which "
      "helicarm subtracts and propagates as one error common to all views",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Ball>)
          if (!reader.raw("covariance_mm2").is_null())
            ball.covariance_mm2 = covariance_from(reader, "covariance_mm2", 3);
      },
      [&] { return ball.covariance_mm2 ? std::optional(rows_of(*ball.covariance_mm2)) : std::nullopt; });
}

template <class Codec, class Target>
void describe_target(Codec& codec, Target& target) {
  codec.text("name", target.name, "unique among fiducials and targets", name_limits);
  codec.vector("xyz_mm", target.point_in_calibrator, coordinate_range, "of the point");
  codec.required_choice(
      "kind", target.kind, target_words,
      "a ball; two wires whose axes meet at `xyz_mm`; a wire that ends at `xyz_mm` with a flat face");
  codec.number("diameter_mm", target.diameter_mm, diameter_range, "of the ball or wire");
  codec.custom(
      "directions", false, {{"type", "array"}, {"maxItems", 2}, {"items", {{"type", "array"}}}},
      "unit vectors (within 0.001): two for a cross, not parallel; one for a line end, from the end into the "
      "wire; none "
      "for a ball",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Target>) read_directions(target, reader);
      },
      [&] { return target.directions.empty() ? std::nullopt : std::optional(rows_of(target.directions)); });
  if (codec.wants(target.length_mm > 0))
    codec.custom(
        "length_mm", false, {{"type", "number"}, {"minimum", 0.1}, {"maximum", 1000}},
        "of a wire; `null` or absent: not known",
        [&](JsonReader& reader) {
          if constexpr (!std::is_const_v<Target>)
            target.length_mm = reader.optional_number("length_mm", {0.1, 1000}).value_or(0);
        },
        [&] { return std::optional(Json(target.length_mm)); });
}

/// calibrator.json (docs/formats.md).
template <class Codec, class CalibratorValue>
void describe_calibrator(Codec& codec, CalibratorValue& calibrator) {
  constexpr bool reads = !std::is_const_v<CalibratorValue>;
  codec.text("name", calibrator.name, "of the calibrator", name_limits);
  codec.list("balls", calibrator.balls, true, most_balls,
             "the fiducials, 6 or more; their labels are found in images of up to 200",
             [](auto& entry, auto& ball) { describe_ball(entry, ball); });
  codec.list("targets", calibrator.targets, false, most_balls,
             "check points, never used for calibration: TRE is theirs",
             [](auto& entry, auto& target) { describe_target(entry, target); });
  if (codec.wants(calibrator.tolerance_mm > 0))
    codec.number_or_default("tolerance_mm", calibrator.tolerance_mm, tolerance_range,
                            "standard deviation per axis of every fiducial's position. Its square is added "
                            "to `covariance_mm2`. Labelling, "
                            "calibration and rejection use it; the estimated deviations of the fiducials "
                            "from the file are reported in the "
                            "note `calibrator_deviates`");
  if (codec.wants(calibrator.scale_sigma > 0))
    codec.number_or_default("scale_sigma", calibrator.scale_sigma, scale_sigma_range,
                            "relative standard error of the scale common to all coordinates");
  codec.custom(
      "measured", false, {{"type", "object"}},
      "of any content: how the coordinates were obtained. Copied to `calibrator.measured` of results",
      [&](JsonReader& reader) {
        if constexpr (reads) {
          calibrator.measured = reader.raw("measured");
          if (!calibrator.measured.is_null() && !calibrator.measured.is_object())
            reader.refuse(Reason::bad_value, "measured", "is not an object");
        }
      },
      [&] { return calibrator.measured.is_null() ? std::nullopt : std::optional(calibrator.measured); });
  codec.custom(
      "joint_covariance", false, {{"type", "object"}},
      "covariance of all centres together: `{\"balls\": [labels], \"mm2\": 3n x 3n}`, 1 to 100 labels, which "
      "include "
      "those of all `balls` (further ones are ignored); its blocks equal the balls' `covariance_mm2`",
      [&](JsonReader& reader) {
        if constexpr (reads)
          if (!reader.raw("joint_covariance").is_null())
            calibrator.joint_covariance =
                joint_covariance_from(reader.object("joint_covariance"), calibrator.balls);
      },
      [&] {
        return calibrator.joint_covariance ? std::optional(to_json(*calibrator.joint_covariance))
                                           : std::nullopt;
      });
}

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
    FromJson codec(reader);
    describe_calibrator(codec, calibrator);
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
  ToJson codec;
  describe_calibrator(codec, calibrator);
  return std::move(codec.json);
}

Json calibrator_schema() {
  const Calibrator shape;
  return schema_of("calibrator.json", [&](ToSchema& codec) { describe_calibrator(codec, shape); });
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
