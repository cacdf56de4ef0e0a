// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/in_space.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/geometry/small_matrix.h"
#include "helicarm/measures/reference.h"

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

/// Of the plateau's width: in any plane that holds it.
Projection projection_of(Kind kind, const Vector3d& axis) {
  return Projection(kind == Kind::tibia_ml ? axis.unitOrthogonal() : Vector3d(axis.normalized()));
}

/// In the projection of these landmarks, taken as exact.
struct Projected {
  std::vector<Click> clicks;
  Measure measure;
};

Projected projected(Kind kind, std::span<const Landmark> landmarks, const Axis& axis) {
  const Projection projection = projection_of(kind, axis.of(landmarks));
  std::vector<Click> clicks;
  for (const Landmark& each : landmarks)
    if (each.name != axis_medial && each.name != axis_lateral)
      clicks.push_back({each.name, projection.across * each.at, Eigen::Matrix2d::Zero()});
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
    throw BadInput(std::move(failure));
  }
  measure->depth_mm.reset();
  return {std::move(clicks), *std::move(measure)};
}

/// Square root of a covariance, by columns.
Eigen::Matrix3d root_of(const Eigen::Matrix3d& covariance) {
  const auto principal = geometry::symmetric_eigen(covariance);
  return principal.vectors * principal.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Adds what the landmarks' errors contribute in three dimensions, also by the projection that they
/// determine: central differences over a thousandth of a standard deviation.
void add_errors(const Axis& axis, std::span<const Landmark> landmarks, Measure& measure) {
  constexpr double part = 1e-3;
  std::vector<Landmark> moved(landmarks.begin(), landmarks.end());
  for (Landmark& each : moved) {
    const Vector3d at = each.at;
    const Eigen::Matrix3d root = root_of(each.covariance_mm2);
    for (const auto& column : root.colwise()) {
      if (column.isZero(0)) continue;
      each.at = at + part * column;
      const Measure up = projected(measure.kind, moved, axis).measure;
      each.at = at - part * column;
      const Measure down = projected(measure.kind, moved, axis).measure;
      for (std::size_t i = 0; i < measure.positions.size(); ++i) {
        const Eigen::VectorXd step = (up.positions[i].percent - down.positions[i].percent) / (2 * part);
        measure.positions[i].covariance += step * step.transpose();
      }
      for (std::size_t i = 0; i < measure.quantities.size(); ++i)
        if (auto& sigma = measure.quantities[i].sigma)
          sigma = std::hypot(*sigma, (up.quantities[i].value - down.quantities[i].value) / (2 * part));
    }
    each.at = at;
  }
}

/// Of the positions with all their errors.
void warn_of_positions(const KindInfo& info, std::span<const Click> clicks, Measure& measure) {
  const PercentAxes axes{info.kind, value_or_throw(assigned(info, clicks))};
  PlanarPoints points;
  for (const Click& click : clicks) points.push_back(click.uv);
  for (std::size_t i = 0; i < measure.positions.size(); ++i)
    measure.positions[i].warnings =
        reference_warnings(axes, measure.positions[i], points, axes.clicks.further[i]);
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
    auto [clicks, measure] = projected(kind, landmarks, axis);
    add_errors(axis, landmarks, measure);
    warn_of_positions(info, clicks, measure);
    return std::move(measure);
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
