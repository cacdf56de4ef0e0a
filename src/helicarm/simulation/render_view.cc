// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/render_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "helicarm/core/parallel.h"
#include "helicarm/simulation/ray_row.h"

namespace helicarm::simulation {
namespace {

using Eigen::Array3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Metal path length (mm) may differ by this much between neighbours before a pixel is supersampled.
constexpr double edge_mm = 0.05;

struct Bounds {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;

  bool holds(const Vector2d& pixel) const {
    return (pixel.array() >= low.array()).all() && (pixel.array() <= high.array()).all();
  }
};

const Bounds everywhere{Bounds{}.high, Bounds{}.low};

/// A rectangle of ideal pixels that contains the solid's shadow.
Bounds shadow(const Solid& solid, const geometry::View& view) {
  Bounds bounds;
  for (const Vector3d& corner : solid.corners()) {
    if (view.depth(corner) <= 1) return everywhere;
    const Vector2d pixel = view.project(corner);
    bounds.low = bounds.low.cwiseMin(pixel);
    bounds.high = bounds.high.cwiseMax(pixel);
  }
  return bounds;
}

/// Ideal pixel coordinates of a row, without distortion.
struct IdealRow {
  std::vector<Vector2d> pixels;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
};

/// The range of pixels inside the box.
RayRange rays_within(const Bounds& box, const IdealRow& ideal, RayRange range) {
  if (box.high.y() < ideal.low || box.low.y() > ideal.high) return {};
  while (range.first < range.last && !box.holds(ideal.pixels[range.first])) ++range.first;
  while (range.first < range.last && !box.holds(ideal.pixels[range.last - 1])) --range.last;
  return range;
}

/// Pixels inside the field, and one more on each side to detect metal edges.
RayRange lit_range(const std::vector<double>& weight) {
  RayRange lit{0, weight.size()};
  while (lit.first < lit.last && weight[lit.first] == 0) ++lit.first;
  while (lit.first < lit.last && weight[lit.last - 1] == 0) --lit.last;
  if (lit.first > 0) --lit.first;
  if (lit.last < weight.size()) ++lit.last;
  return lit;
}

class RayTracer {
 public:
  RayTracer(const Scene& scene, const VirtualDetector& detector, const geometry::View& view, const CtBody* ct)
      : scene_(scene), detector_(detector), ct_(ct), source_(view.source_in_world()) {
    direction_from_pixel_ = view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
    for (const Body& body : scene) {
      std::vector<Bounds>& bounds = bounds_.emplace_back();
      for (const Solid& solid : body.solids) bounds.push_back(shadow(solid, view));
    }
  }

  /// Traces the row's central rays; `metal` receives their path lengths in metal (mm).
  void trace_row(int v, float* signal, float* metal) const {
    const std::vector<double> weight = row_of_weights(v);
    const RayRange lit = lit_range(weight);
    IdealRow ideal{std::vector<Vector2d>(weight.size())};
    RayRow rays(source_, weight.size());
    for (std::size_t u = lit.first; u < lit.last; ++u) {
      const Vector2d pixel = detector_.distortion.ideal_from_raw({static_cast<double>(u), v});
      ideal.pixels[u] = pixel;
      ideal.low = std::min(ideal.low, pixel.y());
      ideal.high = std::max(ideal.high, pixel.y());
      const Vector3d direction = ray(pixel);
      rays.x[u] = direction.x();
      rays.y[u] = direction.y();
      rays.z[u] = direction.z();
    }
    Eigen::ArrayX3d depth = Eigen::ArrayX3d::Zero(static_cast<Eigen::Index>(weight.size()), 3);
    Eigen::ArrayXd path(depth.rows());
    Eigen::ArrayXd in_metal = Eigen::ArrayXd::Zero(depth.rows());
    for (std::size_t i = 0; i < scene_.size(); ++i) {
      std::vector<RayRange> of_solid;
      RayRange range{lit.last, lit.first};
      for (const Bounds& box : bounds_[i]) {
        of_solid.push_back(rays_within(box, ideal, lit));
        if (of_solid.back().empty()) continue;
        range.first = std::min(range.first, of_solid.back().first);
        range.last = std::max(range.last, of_solid.back().last);
      }
      if (range.empty()) continue;
      union_lengths(scene_[i].solids, rays, range, of_solid, path.data());
      const auto first = static_cast<Eigen::Index>(range.first);
      const auto count = static_cast<Eigen::Index>(range.last - range.first);
      for (Eigen::Index line = 0; line < 3; ++line)
        depth.col(line).segment(first, count) += scene_[i].attenuation[line] * path.segment(first, count);
      if (scene_[i].metal) in_metal.segment(first, count) += path.segment(first, count);
    }
    if (ct_) add_ct(rays, lit, depth);
    using RowOfFloats = Eigen::Map<Eigen::ArrayXf>;
    RowOfFloats(signal, depth.rows()) = (Eigen::Map<const Eigen::ArrayXd>(weight.data(), depth.rows()) *
                                         ((-depth.col(0)).exp() * beam[0] + (-depth.col(1)).exp() * beam[1] +
                                          (-depth.col(2)).exp() * beam[2]))
                                            .cast<float>();
    RowOfFloats(metal, depth.rows()) = in_metal.cast<float>();
  }

  float supersampled(int u, int v) const {
    std::array<Vector2d, 9> raw;
    std::array<Vector3d, 9> direction;
    std::array<Array3d, 9> depth;
    for (std::size_t i = 0; i < 9; ++i) {
      raw[i] = Vector2d(u + (static_cast<int>(i % 3) - 1) / 3.0, v + (static_cast<int>(i / 3) - 1) / 3.0);
      const Vector2d ideal = detector_.distortion.ideal_from_raw(raw[i]);
      direction[i] = ray(ideal);
      depth[i] = depth_of_scene(ideal, direction[i]);
    }
    if (ct_) ct_->add_depths(source_, direction, depth);
    double sum = 0;
    for (std::size_t i = 0; i < 9; ++i)
      sum += field_weight(detector_, raw[i]) * (beam * (-depth[i]).exp()).sum();
    return static_cast<float>(sum / 9);
  }

 private:
  /// Unit vector.
  Vector3d ray(const Vector2d& ideal) const {
    return (direction_from_pixel_ * Vector3d(ideal.x(), ideal.y(), 1)).normalized();
  }

  std::vector<double> row_of_weights(int v) const {
    std::vector<double> weight(static_cast<std::size_t>(detector_.width));
    for (std::size_t u = 0; u < weight.size(); ++u)
      weight[u] = field_weight(detector_, {static_cast<double>(u), v});
    return weight;
  }

  void add_ct(const RayRow& rays, const RayRange& lit, Eigen::ArrayX3d& depth) const {
    std::vector<Vector3d> direction;
    for (std::size_t u = lit.first; u < lit.last; ++u)
      direction.emplace_back(rays.x[u], rays.y[u], rays.z[u]);
    std::vector<Array3d> in_ct(direction.size(), Array3d::Zero());
    ct_->add_depths(source_, direction, in_ct);
    for (std::size_t i = 0; i < in_ct.size(); ++i)
      depth.row(static_cast<Eigen::Index>(lit.first + i)) += in_ct[i].transpose();
  }

  Array3d depth_of_scene(const Vector2d& ideal, const Vector3d& direction) const {
    Array3d depth = Array3d::Zero();
    for (std::size_t i = 0; i < scene_.size(); ++i)
      if (std::ranges::any_of(bounds_[i], [&](const Bounds& box) { return box.holds(ideal); }))
        depth += union_length(scene_[i].solids, source_, direction) * scene_[i].attenuation;
    return depth;
  }

  const Scene& scene_;
  const VirtualDetector& detector_;
  const CtBody* ct_;
  Vector3d source_;
  Eigen::Matrix3d direction_from_pixel_;
  std::vector<std::vector<Bounds>> bounds_;  ///< for each body's solids
};

bool at_edge(const image::Image<float>& metal, int u, int v) {
  const float here = metal(u, v);
  for (int row = std::max(v - 1, 0); row <= std::min(v + 1, metal.height() - 1); ++row)
    for (int column = std::max(u - 1, 0); column <= std::min(u + 1, metal.width() - 1); ++column)
      if (std::abs(metal(column, row) - here) > edge_mm) return true;
  return false;
}

}  // namespace

double field_weight(const VirtualDetector& detector, const Vector2d& raw) {
  if (!detector.field_radius_px) return 1;
  const double inside = *detector.field_radius_px - (raw - detector.distortion.centre_px).norm();
  return std::clamp(inside + 0.5, 0.0, 1.0);
}

image::Image<float> render_view(const Scene& scene, const VirtualDetector& detector,
                                const geometry::View& view, unsigned threads, const CtBody* ct) {
  const RayTracer tracer(scene, detector, view, ct);
  image::Image<float> image(detector.width, detector.height);
  image::Image<float> metal(detector.width, detector.height);
  const auto rows = static_cast<std::size_t>(detector.height);
  parallel_for(rows, threads, [&](std::size_t row) {
    const int v = static_cast<int>(row);
    tracer.trace_row(v, image.row(v), metal.row(v));
  });
  parallel_for(rows, threads, [&](std::size_t row) {
    const int v = static_cast<int>(row);
    for (int u = 0; u < detector.width; ++u)
      if (at_edge(metal, u, v)) image(u, v) = tracer.supersampled(u, v);
  });
  return image;
}

}  // namespace helicarm::simulation
