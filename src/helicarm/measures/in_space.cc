// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/in_space.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/geometry/small_matrix.h"

namespace helicarm::measures {
namespace {

using Eigen::Vector3d;

constexpr double least_axis_mm = 10, least_length_mm = 1;

/// Directions along and across which the bone is seen.
struct Projection {
  Eigen::Matrix<double, 2, 3> across;

  explicit Projection(const Vector3d& along) {
    const Vector3d other = along.unitOrthogonal();
    across << other.transpose(), along.cross(other).normalized().transpose();
  }
};

std::optional<std::size_t> index_of(std::span<const Landmark> landmarks, std::string_view name) {
  const auto found = std::ranges::find(landmarks, name, &Landmark::name);
  if (found == landmarks.end()) return std::nullopt;
  return std::size_t(found - landmarks.begin());
}

struct Axis {
  std::size_t from, to;
  Vector3d of(std::span<const Landmark> landmarks) const { return landmarks[to].at - landmarks[from].at; }
};

/// Of the plateau's width, an axis is its own.
Expected<Axis> axis_of(const KindInfo& info, std::span<const Landmark> landmarks) {
  const bool is_width = info.kind == Kind::tibia_ml;
  const std::string_view from = is_width ? "medial" : axis_medial, to = is_width ? "lateral" : axis_lateral;
  for (const std::string_view end : {from, to})
    if (!index_of(landmarks, end))
      return fail(Reason::bad_value,
                  fmt::format("{}: \"{}\" is missing: {}", info.word, end,
                              is_width ? "the tibial plateau's margin"
                                       : "an end of the axis along which the bone is seen from the side"));
  const Axis axis{*index_of(landmarks, from), *index_of(landmarks, to)};
  const double length = axis.of(landmarks).norm();
  if (length < least_axis_mm)
    return fail(Reason::bad_value,
                fmt::format("{}: \"{}\" and \"{}\" are {:.2g} mm apart, must be {:g} mm or more", info.word,
                            from, to, length, least_axis_mm),
                {{"length_mm", length}, {"limit_mm", least_axis_mm}});
  return axis;
}

Projection projection_of(Kind kind, const Vector3d& axis) {
  return Projection(kind == Kind::tibia_ml ? axis.unitOrthogonal() : Vector3d(axis.normalized()));
}

Expected<Measure> projected(Kind kind, std::span<const Landmark> landmarks, const Projection& projection) {
  std::vector<Click> clicks;
  for (const Landmark& each : landmarks)
    if (each.name != axis_medial && each.name != axis_lateral)
      clicks.push_back({each.name, projection.across * each.at,
                        projection.across * each.covariance_mm2 * projection.across.transpose()});
  const ObjectPlane mm{{1, 1, 0, 0}, 1};
  auto measure = measures::measure(kind, clicks, mm);
  if (!measure) {
    Failure failure = std::move(measure).error();
    if (const auto length = failure.figures.find("length_px"); length != failure.figures.end())
      failure = {Reason::bad_value,
                 fmt::format("{}: the landmarks for 0 and 100 % are {:.2g} mm apart, must be {:g} mm or more",
                             info_of(kind).word, length->second, least_length_mm),
                 {},
                 {{"length_mm", length->second}, {"limit_mm", least_length_mm}}};
    return tl::unexpected<Failure>(std::move(failure));
  }
  measure->depth_mm.reset();
  return measure;
}

/// Square root of a covariance, by columns.
Eigen::Matrix3d root_of(const Eigen::Matrix3d& covariance) {
  const auto principal = geometry::symmetric_eigen(covariance);
  return principal.vectors * principal.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Adds what the error of the axis' ends contributes, by central differences over a standard deviation.
Expected<void> add_axis_error(const Axis& axis, std::span<const Landmark> landmarks, Measure& measure) {
  return guarded([&] {
    for (const std::size_t end : {axis.from, axis.to}) {
      const Eigen::Matrix3d root = root_of(landmarks[end].covariance_mm2);
      for (int column = 0; column < 3; ++column) {
        if (root.col(column).isZero(0)) continue;
        const auto moved = [&](double sign) {
          std::vector<Landmark> all(landmarks.begin(), landmarks.end());
          all[end].at += sign * root.col(column);
          return value_or_throw(
              projected(measure.kind, landmarks, projection_of(measure.kind, axis.of(all))));
        };
        const Measure up = moved(1), down = moved(-1);
        for (std::size_t i = 0; i < measure.positions.size(); ++i) {
          const Eigen::VectorXd step = (up.positions[i].percent - down.positions[i].percent) / 2;
          measure.positions[i].covariance += step * step.transpose();
        }
        for (std::size_t i = 0; i < measure.quantities.size(); ++i)
          if (auto& sigma = measure.quantities[i].sigma)
            sigma = std::hypot(*sigma, (up.quantities[i].value - down.quantities[i].value) / 2);
      }
    }
  });
}

}  // namespace

Expected<Measure> measure_in_space(Kind kind, std::span<const Landmark> landmarks) {
  return guarded([&] {
    const KindInfo& info = info_of(kind);
    if (info.components.empty())
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: is a measure of one image; in space: femoral_quadrants, tibia_ap, "
                                 "tibia_ml",
                                 info.word));
    for (const Landmark& each : landmarks)
      if (std::ranges::count(landmarks, each.name, &Landmark::name) > 1)
        throw BadInput(Reason::bad_value, fmt::format("{}: \"{}\" is given twice", info.word, each.name));
    const Axis axis = value_or_throw(axis_of(info, landmarks));
    Measure measure = value_or_throw(projected(kind, landmarks, projection_of(kind, axis.of(landmarks))));
    if (kind != Kind::tibia_ml) value_or_throw(add_axis_error(axis, landmarks, measure));
    return measure;
  });
}

Expected<Lateral> lateral_of(const geometry::View& view, const Vector3d& medial, const Vector3d& lateral) {
  const Vector3d middle = (medial + lateral) / 2, axis = (lateral - medial).normalized();
  for (const Vector3d& end : {medial, lateral})
    if (!(view.depth(end) > 0))
      return fail(Reason::behind_source, "the axis lies behind the view's source",
                  {{"depth_mm", view.depth(end)}});
  const Vector3d ray = (middle - view.source_in_world()).normalized();
  const double off = std::acos(std::min(1.0, std::abs(ray.dot(axis)))) * 180 / std::numbers::pi;
  const double mm_per_px = view.depth(middle) / std::abs(view.intrinsics.fy);
  return Lateral{off, (view.project(medial) - view.project(lateral)).norm() * mm_per_px};
}

}  // namespace helicarm::measures
