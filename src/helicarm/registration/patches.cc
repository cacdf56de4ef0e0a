// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/patches.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Patches u0 <= u < u1, v0 <= v < v1.
struct Box {
  int u0, v0, u1, v1;
  int width() const { return std::max(0, u1 - u0); }
  int height() const { return std::max(0, v1 - v0); }
  bool contains(const Vector2d& at) const {
    return at.x() >= u0 && at.x() < u1 && at.y() >= v0 && at.y() < v1;
  }
  std::size_t index(int u, int v) const {
    return std::size_t(v - v0) * std::size_t(width()) + std::size_t(u - u0);
  }
};

/// Patches that the density's grid may cover.
Box patches_of(const Raster& raster, const geometry::View& view, const Density& density,
               const geometry::RigidTransform& world_from_model, int side) {
  Vector2d low = Vector2d::Constant(1e9), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d voxel((corner & 1) ? density.size.x() - 1 : 0, (corner & 2) ? density.size.y() - 1 : 0,
                         (corner & 4) ? density.size.z() - 1 : 0);
    const Vector3d in_world = world_from_model * (density.model_from_voxel * voxel);
    if (!(view.depth(in_world) > 1)) return {0, 0, 0, 0};
    const Vector2d at = raster.raster_at(view.project(in_world));
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  // A body that is mostly beyond the image needs no more patches than the image has.
  const auto first = [&](double at, int size) {
    return static_cast<int>(std::floor(std::max(-0.5 * size, at) / side));
  };
  const auto end = [&](double at, int size) {
    return static_cast<int>(std::floor(std::min(1.5 * size, at) / side)) + 1;
  };
  const int width = raster.attenuation.width(), height = raster.attenuation.height();
  return {first(low.x(), width), first(low.y(), height), end(high.x(), width), end(high.y(), height)};
}

/// Differences between neighbours along u, then along v, each without their mean over what is `shown` (1 or 0
/// per difference; empty: all), and zero elsewhere.
Eigen::VectorXf differences(const Eigen::Ref<const Eigen::VectorXf>& pixels, const Eigen::VectorXf& shown,
                            int side) {
  const int half = side * (side - 1);
  Eigen::VectorXf rows(2 * half);
  int row = 0;
  for (int v = 0; v < side; ++v)
    for (int u = 0; u + 1 < side; ++u) rows[row++] = pixels[v * side + u + 1] - pixels[v * side + u];
  for (int v = 0; v + 1 < side; ++v)
    for (int u = 0; u < side; ++u) rows[row++] = pixels[(v + 1) * side + u] - pixels[v * side + u];
  for (const int first : {0, half}) {
    auto along = rows.segment(first, half);
    if (shown.size() == 0) {
      along.array() -= along.mean();
      continue;
    }
    const auto use = shown.segment(first, half);
    along.array() *= use.array();
    along -= use * (along.sum() / std::max(1.0F, use.sum()));
  }
  return rows;
}

struct Patch {
  int u, v;                    ///< first pixel
  Eigen::VectorXf shown = {};  ///< 1 or 0 per difference; empty: all are in the usable part of the image
  Eigen::VectorXf drr = {};    ///< differences
  Eigen::VectorXf seen = {};
  float contrast = 0;  ///< norm of all the DRR's differences
  float share = 1;     ///< of its square, that is shown
};

/// What the image does not show counts as half a disagreement: to hide parts must not raise the score.
constexpr float hidden_weight = 0.5F;
constexpr float least_share = 0.25F;  // of a patch that takes part

class Comparer {
 public:
  Comparer(const Raster& raster, const geometry::View& view, const Density& density,
           const geometry::RigidTransform& world_from_model, const Vector3d& centre,
           const PatchOptions& options)
      : raster_(raster),
        hardening_(density.hardening),
        posed_(density, world_from_model, view.source_in_world(), centre),
        world_from_pixel_(view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse()),
        options_(options) {}

  Patch rendered(int u, int v) const {
    Patch patch{u, v};
    const int side = options_.side;
    if (is_empty(u, v)) return patch;
    Eigen::VectorXf pixels(side * side);
    std::array<float, 8> values;
    for_eights(u, v, [&](const std::array<Vector3d, 8>& directions, int first, int count) {
      posed_.integrate_eight(directions, values);
      for (int k = 0; k < count; ++k) pixels[first + k] = values[std::size_t(k)];
    });
    if (hardening_ > 0) pixels = (1 - (-hardening_ * pixels.array()).exp()) / hardening_;
    patch.drr = differences(pixels, {}, side);
    patch.contrast = patch.drr.norm();
    patch.shown = shown(u, v);
    if (patch.shown.size() > 0 && patch.contrast > 0) {
      patch.drr = differences(pixels, patch.shown, side);
      patch.share = patch.drr.squaredNorm() / (patch.contrast * patch.contrast);
      if (patch.share < least_share) patch.share = 0;
    }
    return patch;
  }

  Eigen::VectorXf seen(const Patch& patch) const {
    const int side = options_.side;
    Eigen::VectorXf pixels(side * side);
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i)
        pixels[j * side + i] =
            usable(patch.u + i, patch.v + j) ? raster_.attenuation(patch.u + i, patch.v + j) : 0;
    return differences(pixels, patch.shown, side);
  }

  Comparison compare(const Patch& patch, float noise, bool derivatives, double& residual) const {
    Comparison comparison;
    const int side = options_.side;
    comparison.pixel = raster_.pixel_at(Vector2d(patch.u, patch.v) + Vector2d::Constant(0.5 * (side - 1)));
    comparison.weight = patch.contrast * patch.share;
    const float seen2 = patch.seen.squaredNorm() + noise, drr2 = patch.drr.squaredNorm();
    const float both = patch.seen.dot(patch.drr);
    comparison.agreement = both / std::sqrt(seen2 * drr2);
    residual = 0;
    if (!derivatives || both <= 0) return comparison;
    const double misfit = 1 - comparison.agreement * comparison.agreement;
    const double robust = std::pow(1 + misfit / options_.robust_misfit, -2);
    const float gain = both / drr2;
    Eigen::Matrix<float, Eigen::Dynamic, affine_parameters> pixels(side * side, affine_parameters);
    std::array<RayIntegral, 8> rays;
    for_eights(patch.u, patch.v, [&](const std::array<Vector3d, 8>& directions, int first, int count) {
      posed_.differentiate_eight(directions, rays);
      for (int k = 0; k < count; ++k) {
        const RayIntegral& ray = rays[std::size_t(k)];
        pixels.row(first + k) = slope(ray.value) * ray.by_motion.transpose();
      }
    });
    Eigen::Matrix<float, Eigen::Dynamic, affine_parameters> jacobian(patch.drr.size(), affine_parameters);
    for (int k = 0; k < affine_parameters; ++k)
      jacobian.col(k) = differences(pixels.col(k), patch.shown, side);
    jacobian -= patch.drr * (patch.drr.transpose() * jacobian / drr2).eval();
    jacobian *= gain;
    const Eigen::VectorXf difference = patch.seen - gain * patch.drr;
    const double weight = comparison.weight * robust / seen2;
    comparison.information.topLeftCorner<affine_parameters, affine_parameters>() =
        weight * (jacobian.transpose() * jacobian).cast<double>();
    comparison.gradient.head<affine_parameters>() =
        weight * (jacobian.transpose() * difference).cast<double>();
    return comparison;
  }

 private:
  bool usable(int u, int v) const { return raster_.attenuation.contains(u, v) && raster_.valid(u, v); }

  /// As `Patch::shown`.
  Eigen::VectorXf shown(int u, int v) const {
    const int side = options_.side;
    Eigen::VectorXf pixels(side * side);
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) pixels[j * side + i] = usable(u + i, v + j) ? 1.0F : 0.0F;
    if (pixels.minCoeff() > 0) return {};
    Eigen::VectorXf both(2 * side * (side - 1));
    int row = 0;
    for (int j = 0; j < side; ++j)
      for (int i = 0; i + 1 < side; ++i) both[row++] = pixels[j * side + i] * pixels[j * side + i + 1];
    for (int j = 0; j + 1 < side; ++j)
      for (int i = 0; i < side; ++i) both[row++] = pixels[j * side + i] * pixels[(j + 1) * side + i];
    return both;
  }

  /// Calls `take(directions, first, count)` for the rays of a patch, eight at a time.
  template <class Take>
  void for_eights(int u, int v, const Take& take) const {
    const int side = options_.side;
    std::array<Vector3d, 8> directions;
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; i += 8) {
        for (int k = 0; k < 8; ++k)
          directions[std::size_t(k)] = direction(u + std::min(i + k, side - 1), v + j);
        take(directions, j * side + i, std::min(8, side - i));
      }
  }

  /// Whether eight rays spread over the patch miss the model.
  bool is_empty(int u, int v) const {
    const int last = options_.side - 1, half = last / 2;
    std::array<float, 8> values;
    posed_.integrate_eight(
        {direction(u, v), direction(u + half, v), direction(u + last, v), direction(u + half / 2, v + half),
         direction(u + last - half / 2, v + half), direction(u, v + last), direction(u + half, v + last),
         direction(u + last, v + last)},
        values);
    return std::ranges::all_of(values, [](float value) { return value == 0; });
  }

  Vector3d direction(int u, int v) const {
    const Vector2d pixel = raster_.pixel_at(Vector2d(u, v));
    return (world_from_pixel_ * pixel.homogeneous()).normalized();
  }

  /// d attenuation / d line integral.
  float slope(float integral) const { return std::exp(-hardening_ * integral); }

  const Raster& raster_;
  float hardening_;
  PosedDensity posed_;
  Eigen::Matrix3d world_from_pixel_;
  const PatchOptions& options_;
};

/// Which patches of the box, row by row, show a cut, and their neighbours.
std::vector<char> cut_patches(const Raster& raster, const geometry::View& view,
                              const geometry::RigidTransform& world_from_model,
                              const std::vector<Vector3d>& cuts, int side, const Box& box) {
  std::vector<char> cut(std::size_t(box.width()) * std::size_t(box.height()), 0);
  for (const Vector3d& point : cuts) {
    const Vector3d in_world = world_from_model * point;
    if (!(view.depth(in_world) > 1)) continue;
    const Vector2d at = raster.raster_at(view.project(in_world)) / side;
    for (const double du : {-0.25, 0.25})
      for (const double dv : {-0.25, 0.25}) {
        const Vector2d patch = Vector2d(at.x() + du, at.y() + dv).array().floor();
        if (box.contains(patch)) cut[box.index(int(patch.x()), int(patch.y()))] = 1;
      }
  }
  return cut;
}

}  // namespace

ViewObservation compare_patches(const Raster& raster, const geometry::View& view, const Density& density,
                                const std::vector<Vector3d>& cuts,
                                const geometry::RigidTransform& world_from_model, const Vector3d& centre,
                                bool derivatives, unsigned threads, const PatchOptions& options) {
  const int side = options.side;
  const Box box = patches_of(raster, view, density, world_from_model, side);
  const auto cut = cut_patches(raster, view, world_from_model, cuts, side, box);
  std::vector<Patch> patches;
  for (int v = box.v0; v < box.v1; ++v)
    for (int u = box.u0; u < box.u1; ++u)
      if (cut[box.index(u, v)] == 0) patches.push_back({u * side, v * side});
  const Comparer comparer(raster, view, density, world_from_model, centre, options);
  parallel_for(patches.size(), threads,
               [&](std::size_t i) { patches[i] = comparer.rendered(patches[i].u, patches[i].v); });
  std::vector<float> contrasts;
  for (const Patch& patch : patches)
    if (patch.contrast > 0) contrasts.push_back(patch.contrast);
  ViewObservation observation;
  if (contrasts.empty()) return observation;
  const auto limit =
      static_cast<float>(options.least_contrast) * value_of_rank(contrasts, contrasts.size() * 9 / 10);
  double total = 0;
  for (const Patch& patch : patches)
    total += patch.contrast * (patch.share + hidden_weight * (1 - patch.share));
  std::erase_if(patches, [&](const Patch& patch) {
    return patch.share == 0 || patch.contrast < limit || patch.contrast == 0;
  });
  float noise = 0;
  for (Patch& patch : patches) {
    patch.seen = comparer.seen(patch);
    noise += 0.01F * patch.seen.squaredNorm() / static_cast<float>(patches.size());
  }
  observation.comparisons.resize(patches.size());
  parallel_for(patches.size(), threads, [&](std::size_t i) {
    double residual = 0;
    observation.comparisons[i] = comparer.compare(patches[i], noise + 1e-12F, derivatives, residual);
  });
  for (Comparison& comparison : observation.comparisons) {
    comparison.weight /= total;
    comparison.information /= total;
    comparison.gradient /= total;
    observation.score += comparison.weight * comparison.agreement;
  }
  return observation;
}

}  // namespace helicarm::registration
