// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/contour.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <Eigen/LU>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/registration/thickness.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// The surface's shadow on a grid of cells.
class Shadow {
 public:
  Shadow(const std::vector<Vector2d>& corners, const std::vector<std::array<std::uint32_t, 3>>& triangles,
         double cell)
      : cell_(cell) {
    Vector2d low = corners.front(), high = low;
    for (const Vector2d& at : corners) low = low.cwiseMin(at), high = high.cwiseMax(at);
    low_ = low - Vector2d::Constant(2 * cell);
    const Vector2d size = (high - low_) / cell;
    cells_ = image::Image<std::uint8_t>(int(size.x()) + 4, int(size.y()) + 4, 0);
    for (const auto& t : triangles) fill(place(corners[t[0]]), place(corners[t[1]]), place(corners[t[2]]));
  }
  bool covers(const Vector2d& pixel) const {
    const Vector2d at = place(pixel);
    const int u = int(std::floor(at.x() + 0.5)), v = int(std::floor(at.y() + 0.5));
    return cells_.contains(u, v) && cells_(u, v);
  }

 private:
  Vector2d place(const Vector2d& pixel) const { return (pixel - low_) / cell_; }
  void fill(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
    const auto across = [](const Vector2d& p, const Vector2d& q, double u, double v) {
      return (q.x() - p.x()) * (v - p.y()) - (q.y() - p.y()) * (u - p.x());
    };
    const double area = across(a, b, c.x(), c.y());
    if (area == 0) return;
    const auto [u0, u1] = std::minmax({a.x(), b.x(), c.x()});
    const auto [v0, v1] = std::minmax({a.y(), b.y(), c.y()});
    for (int v = int(std::ceil(v0)); v <= int(v1); ++v)
      for (int u = int(std::ceil(u0)); u <= int(u1); ++u) {
        const double x = across(a, b, u, v) / area, y = across(b, c, u, v) / area;
        if (x >= 0 && y >= 0 && x + y <= 1) cells_(u, v) = 1;
      }
  }
  double cell_;
  Vector2d low_;
  image::Image<std::uint8_t> cells_;
};

/// Cells of the shadow's grid, 64 MB; a pose whose shadow is larger shows nothing of the surface.
constexpr double most_shadow_cells = 1 << 26;

bool has_shadow(const std::vector<Vector2d>& pixels, double cell) {
  Vector2d low = pixels.front(), high = low;
  for (const Vector2d& at : pixels) low = low.cwiseMin(at), high = high.cwiseMax(at);
  return ((high - low) / cell + Vector2d::Constant(6)).prod() < most_shadow_cells;
}

/// Share of the contour that counts at least, so that no pose gains by leaving the image.
constexpr double least_visible = 0.5;
constexpr double sample_step = 0.5;  // of the profile, raster pixels
// From the contour, raster pixels: an edge that is predicted farther away is that of another line of it.
constexpr double farthest_edge = 2;

constexpr double cut_reach_mm = 2;  // beside a cut there is its own edge, which the image does not show

/// Attenuation between pixels; nothing where it is not valid.
std::optional<double> attenuation_at(const Raster& raster, const Vector2d& at) {
  const int u = int(std::floor(at.x())), v = int(std::floor(at.y()));
  if (u < 0 || v < 0 || u + 1 >= raster.attenuation.width() || v + 1 >= raster.attenuation.height())
    return std::nullopt;
  if (!raster.valid(u, v) || !raster.valid(u + 1, v) || !raster.valid(u, v + 1) ||
      !raster.valid(u + 1, v + 1))
    return std::nullopt;
  const double x = at.x() - u, y = at.y() - v;
  const auto value = [&](int i, int j) { return double(raster.attenuation(u + i, v + j)); };
  return (1 - y) * ((1 - x) * value(0, 0) + x * value(1, 0)) + y * ((1 - x) * value(0, 1) + x * value(1, 1));
}

/// What `value_at` gives along the normal, samples on either side of the contour's point; three parallel
/// profiles are averaged. Nothing where a part is hidden or beyond the field.
template <class ValueAt>
std::optional<std::vector<double>> profile_along(const ValueAt& value_at, const Vector2d& at,
                                                 const Vector2d& normal, double reach) {
  const int half = int(std::ceil(reach / sample_step)) + 3;
  std::vector<double> profile(std::size_t(2 * half + 1), 0);
  const Vector2d tangent(-normal.y(), normal.x());
  for (int i = -half; i <= half; ++i)
    for (const double aside : {-1.0, 0.0, 1.0}) {
      const std::optional<double> value = value_at(at + i * sample_step * normal + aside * tangent);
      if (!value) return std::nullopt;
      profile[std::size_t(i + half)] += *value / 3;
    }
  return profile;
}

/// Where, outwards in raster pixels, the profile falls most steeply within `reach` of `about`; near places
/// are preferred.
std::optional<double> steepest_fall(const std::vector<double>& profile, double about, double reach) {
  const int half = int(profile.size() / 2);
  // Fall over two pixels about each sample, smoothed over three samples.
  const auto fall = [&](int i) {
    const auto p = [&](int k) { return profile[std::size_t(k + half)]; };
    return (p(i - 2) - p(i + 2) + 0.5 * (p(i - 3) - p(i + 1) + p(i - 1) - p(i + 3))) / 4;
  };
  std::optional<double> best;
  double best_rank = 0;
  for (int i = 4 - half; i < half - 3; ++i) {
    if (std::abs(i - about / sample_step) >= std::ceil(reach / sample_step)) continue;
    const double here = fall(i), before = fall(i - 1), after = fall(i + 1);
    if (!(here > 0 && here >= before && here > after)) continue;
    const double bend = before - 2 * here + after;
    const double offset = sample_step * (i + (bend < 0 ? 0.5 * (before - after) / bend : 0));
    const double rank = here * std::exp(-0.5 * std::pow((offset - about) / (0.5 * reach), 2));
    if (rank > best_rank) best_rank = rank, best = offset;
  }
  return best;
}

bool is_at_cut(const Vector3d& in_model, const std::vector<Vector3d>& cuts) {
  return std::ranges::any_of(cuts,
                             [&](const Vector3d& cut) { return (cut - in_model).norm() < cut_reach_mm; });
}

/// A point of the contour that the image shows.
struct VisiblePoint {
  const ContourPoint* point;
  std::vector<double> profile;
  double predicted_px = 0;              ///< the edge's place; full-resolution pixels, outward
  std::optional<double> residual = {};  ///< from there
};

void find_edges(std::vector<VisiblePoint>& points, double about_px, const Raster& raster, double reach) {
  for (VisiblePoint& point : points) {
    const auto edge = steepest_fall(point.profile, (point.predicted_px + about_px) / raster.factor, reach);
    point.residual = edge ? std::optional(raster.factor * *edge - point.predicted_px) : std::nullopt;
  }
}

/// Expects each edge where the body's thickness falls most steeply: inside the contour of a rounded body, and
/// elsewhere where another line of the contour runs beside it. Points without an edge near them are removed.
void predict_edges(std::vector<VisiblePoint>& points, const Thickness& thickness, const Raster& raster,
                   double reach) {
  const auto thickness_at = [&](const Vector2d& at) { return std::optional(thickness.at(at)); };
  std::erase_if(points, [&](VisiblePoint& point) {
    const auto profile =
        profile_along(thickness_at, raster.raster_at(point.point->pixel), point.point->normal, reach);
    const auto edge = steepest_fall(*profile, 0, reach);
    point.predicted_px = edge ? raster.factor * *edge : 0;
    return !edge || std::abs(*edge) > farthest_edge;
  });
}

/// The offset that most residuals have in common: weighted means from their median on. It lies inwards of the
/// predicted places, as a mask may be grown, and outwards no farther than the contour.
double common_offset(const std::vector<VisiblePoint>& points, const ContourOptions& options) {
  std::vector<double> residuals, predicted;
  for (const VisiblePoint& point : points)
    if (point.residual) residuals.push_back(*point.residual), predicted.push_back(point.predicted_px);
  if (residuals.empty()) return 0;
  double offset = median(residuals);
  constexpr int means = 10;
  for (int i = 0; i < means; ++i) {
    double sum = 0, weights = 0;
    for (const double residual : residuals) {
      const double weight = std::pow(1 + std::pow((residual - offset) / (2 * options.sigma_px), 2), -2);
      sum += weight * residual;
      weights += weight;
    }
    offset = sum / weights;
  }
  return std::clamp(offset, -options.inward_px / 2, std::max(0.0, -median(std::move(predicted))));
}

}  // namespace

std::vector<ContourPoint> apparent_contour(const Surface& surface, const geometry::View& view,
                                           const geometry::RigidTransform& world_from_model,
                                           double spacing_px) {
  const Vector3d source = world_from_model.inverse() * view.source_in_world();
  const auto& mesh = surface.mesh;
  std::vector<Vector2d> pixels;
  pixels.reserve(mesh.corners.size());
  for (const Vector3d& corner : mesh.corners) {
    const Vector3d in_world = world_from_model * corner;
    if (!(view.depth(in_world) > 1)) return {};
    pixels.push_back(view.project(in_world));
  }
  std::vector<double> facing(mesh.triangles.size());
  for (std::size_t i = 0; i < facing.size(); ++i)
    facing[i] = surface.normals[i].dot(source - mesh.corners[mesh.triangles[i][0]]);
  const double cell = std::max(1.0, spacing_px / 2);
  if (!has_shadow(pixels, cell)) return {};
  const Shadow shadow(pixels, mesh.triangles, cell);
  const Eigen::Matrix3d line_from_normal = view.intrinsics.matrix().inverse().transpose() *
                                           view.camera_from_world.rotation * world_from_model.rotation;
  std::vector<ContourPoint> contour;
  std::map<std::pair<int, int>, std::size_t> taken;
  for (const Surface::Edge& edge : surface.edges) {
    const double a = facing[edge.faces[0]], b = facing[edge.faces[1]];
    if (a * b >= 0) continue;
    const Vector2d pixel = 0.5 * (pixels[edge.corners[0]] + pixels[edge.corners[1]]);
    const std::pair<int, int> place(int(std::floor(pixel.x() / spacing_px)),
                                    int(std::floor(pixel.y() / spacing_px)));
    if (taken.contains(place)) continue;
    // Normal of the plane through the source and the edge.
    const Vector3d normal =
        std::abs(b) * surface.normals[edge.faces[0]] + std::abs(a) * surface.normals[edge.faces[1]];
    Vector2d across = (line_from_normal * normal).head<2>();
    if (!(across.norm() > 0)) continue;
    across.normalize();
    const double aside = std::max(2.0, 1.5 * spacing_px);
    if (shadow.covers(pixel + aside * across)) continue;
    taken.emplace(place, contour.size());
    contour.push_back(
        {world_from_model * (0.5 * (mesh.corners[edge.corners[0]] + mesh.corners[edge.corners[1]])), pixel,
         across});
  }
  return contour;
}

ViewObservation compare_contour(const Raster& raster, const geometry::View& view, const Surface& surface,
                                const geometry::RigidTransform& world_from_model, const Vector3d& centre,
                                const ContourOptions& options, const std::vector<Vector3d>& cuts) {
  ViewObservation observation;
  auto contour = apparent_contour(surface, view, world_from_model, contour_spacing * raster.factor);
  if (!cuts.empty())
    std::erase_if(contour, [&, model_from_world = world_from_model.inverse()](const ContourPoint& point) {
      return is_at_cut(model_from_world * point.in_world, cuts);
    });
  const auto value_at = [&](const Vector2d& at) { return attenuation_at(raster, at); };
  std::vector<VisiblePoint> points;
  for (const ContourPoint& point : contour)
    if (auto profile = profile_along(
            value_at, raster.raster_at(point.pixel), point.normal,
            options.reach + (options.inward_px > 0 ? farthest_edge : 0) + options.inward_px / raster.factor))
      points.push_back({&point, std::move(*profile)});
  const std::size_t visible = points.size();
  if (options.inward_px > 0)
    predict_edges(points, Thickness(surface, view, world_from_model, raster), raster, options.reach);
  double offset = 0;
  find_edges(points, offset, raster, options.reach);
  if (options.inward_px > 0) {
    find_edges(points, common_offset(points, options), raster, options.reach);
    offset = common_offset(points, options);
  }
  const double counted =
      std::max(double(points.size()), least_visible * double(contour.size() - (visible - points.size())));
  double sum2 = 0, weights = 0;
  for (const VisiblePoint& seen : points) {
    const ContourPoint& point = *seen.point;
    Comparison comparison;
    comparison.pixel = point.pixel;
    comparison.weight = 1 / counted;
    if (seen.residual) {
      const double residual = *seen.residual - offset;
      comparison.agreement = 1 / (1 + std::pow(residual / (2 * options.sigma_px), 2));
      const Vector3d by_point =
          geometry::projection_jacobian(view, point.in_world).transpose() * point.normal;
      const Vector3d arm = point.in_world - centre;
      Gradient jacobian;
      jacobian.head<3>() = by_point;
      for (int k = 0; k < 3; ++k) jacobian.segment<3>(3 + 3 * k) = by_point[k] * arm;
      jacobian[edge_offset] = 1;
      const double weight = std::pow(comparison.agreement, 2) / (options.sigma_px * options.sigma_px);
      comparison.information = weight * jacobian * jacobian.transpose();
      comparison.gradient = weight * residual * jacobian;
      const double robust = std::pow(comparison.agreement, 2);
      sum2 += robust * residual * residual;
      weights += robust;
    }
    observation.score += comparison.weight * comparison.agreement;
    observation.comparisons.push_back(std::move(comparison));
  }
  observation.residual_px = weights > 0 ? std::sqrt(sum2 / weights) : 0;
  return observation;
}

}  // namespace helicarm::registration
