// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/render_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "helicarm/core/parallel.h"

namespace helicarm::simulation {
namespace {

using Eigen::Array3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Metal's path (mm) may differ by this much between neighbours before the pixel is supersampled.
constexpr double edge_mm = 0.05;

struct Bounds {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;
};

/// A rectangle of ideal pixels that holds the body's shadow.
Bounds shadow(const Body& body, const View& view) {
  Bounds bounds;
  for (const Solid& solid : body.solids)
    for (const Vector3d& corner : solid.corners()) {
      if (view.depth(corner) <= 1) return {bounds.high, bounds.low};
      const Vector2d pixel = view.project(corner);
      bounds.low = bounds.low.cwiseMin(pixel);
      bounds.high = bounds.high.cwiseMax(pixel);
    }
  return bounds;
}

class Tracer {
 public:
  Tracer(const Scene& scene, const VirtualDetector& detector, const View& view, const CtBody* ct)
      : scene_(scene), detector_(detector), ct_(ct), source_(view.source_in_world()) {
    direction_from_pixel_ = view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
    for (const Body& body : scene) bounds_.push_back(shadow(body, view));
  }

  /// Traces the row's central rays; `metal` takes their paths in metal (mm).
  void trace_row(int v, float* signal, float* metal) const {
    const auto width = static_cast<std::size_t>(detector_.width);
    std::vector<Vector2d> ideal(width);
    std::vector<Vector3d> direction(width);
    std::vector<Array3d> depth(width, Array3d::Zero());
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t u = 0; u < width; ++u) {
      ideal[u] = detector_.distortion.ideal_from_raw({static_cast<double>(u), v});
      direction[u] = ray(ideal[u]);
      low = std::min(low, ideal[u].y());
      high = std::max(high, ideal[u].y());
      metal[u] = 0;
    }
    for (std::size_t i = 0; i < scene_.size(); ++i) {
      const Bounds& box = bounds_[i];
      if (box.high.y() < low || box.low.y() > high) continue;
      for (std::size_t u = 0; u < width; ++u) {
        if (ideal[u].x() < box.low.x() || ideal[u].x() > box.high.x()) continue;
        const double path = union_length(scene_[i].solids, source_, direction[u]);
        depth[u] += path * scene_[i].attenuation;
        if (scene_[i].metal) metal[u] += static_cast<float>(path);
      }
    }
    if (ct_) ct_->add_depths(source_, direction, depth);
    for (std::size_t u = 0; u < width; ++u)
      signal[u] = static_cast<float>(field_weight(detector_, {static_cast<double>(u), v}) *
                                     (beam * (-depth[u]).exp()).sum());
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
  /// Of unit length.
  Vector3d ray(const Vector2d& ideal) const {
    return (direction_from_pixel_ * Vector3d(ideal.x(), ideal.y(), 1)).normalized();
  }

  Array3d depth_of_scene(const Vector2d& ideal, const Vector3d& direction) const {
    Array3d depth = Array3d::Zero();
    for (std::size_t i = 0; i < scene_.size(); ++i)
      if ((ideal.array() >= bounds_[i].low.array()).all() && (ideal.array() <= bounds_[i].high.array()).all())
        depth += union_length(scene_[i].solids, source_, direction) * scene_[i].attenuation;
    return depth;
  }

  const Scene& scene_;
  const VirtualDetector& detector_;
  const CtBody* ct_;
  Vector3d source_;
  Eigen::Matrix3d direction_from_pixel_;
  std::vector<Bounds> bounds_;
};

bool at_edge(const Image<float>& metal, int u, int v) {
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

Image<float> render_view(const Scene& scene, const VirtualDetector& detector, const View& view,
                         unsigned threads, const CtBody* ct) {
  const Tracer tracer(scene, detector, view, ct);
  Image<float> picture(detector.width, detector.height);
  Image<float> metal(detector.width, detector.height);
  const auto rows = static_cast<std::size_t>(detector.height);
  parallel_for(rows, threads, [&](std::size_t row) {
    const int v = static_cast<int>(row);
    tracer.trace_row(v, picture.row(v), metal.row(v));
  });
  parallel_for(rows, threads, [&](std::size_t row) {
    const int v = static_cast<int>(row);
    for (int u = 0; u < detector.width; ++u)
      if (at_edge(metal, u, v)) picture(u, v) = tracer.supersampled(u, v);
  });
  return picture;
}

}  // namespace helicarm::simulation
