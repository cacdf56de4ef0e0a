// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/registration/flat_cut.h"
#include "helicarm/registration/voxel_surface.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double soft_tissue_hu = 50;
constexpr float air_hu = -800;
// Of bone, per 1000 HU mm: its effective attenuation falls to 0.8 behind 30 mm of 1000 HU (75 kV, 2.5 mm Al
// and 12 cm of water; mass attenuation of Hubbell and Seltzer 2004).
constexpr float bone_hardening = 0.006F;
constexpr std::size_t sample_count = 60;
constexpr float matter = 0.1F;  // least density that is of a body

/// Density of a voxel, 1 per 1000 HU.
float density_of(float hu, bool inside, const std::optional<HuWindow>& window, bool excess) {
  if (!excess) return hu < air_hu ? 0.0F : std::max(0.0F, 1 + hu / 1000);
  if (!inside || (window && static_cast<double>(hu) < window->low)) return 0;
  const double value = window ? std::min(static_cast<double>(hu), window->high) : static_cast<double>(hu);
  return static_cast<float>((value - soft_tissue_hu) / 1000);
}

/// Adds what the voxels on the body's boundary hold of it (partial volume): those outside beside a denser one
/// inside. Without them the body would be thinner, and a single view would take it for nearer to the source.
void add_boundary(Density& density, const std::vector<float>& hu) {
  const std::vector<float> body = density.values;
  const std::array<std::ptrdiff_t, 3> strides = {1, density.size.x(),
                                                 std::ptrdiff_t{density.size.x()} * density.size.y()};
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x) {
        const std::size_t i = density.index(x, y, z);
        if (body[i] != 0 || hu[i] <= soft_tissue_hu) continue;
        const Vector3i at(x, y, z);
        for (int axis = 0; axis < 3 && density.values[i] == 0; ++axis)
          for (const int way : {-1, 1}) {
            if (at[axis] + way < 0 || at[axis] + way >= density.size[axis]) continue;
            const std::size_t beside = i + std::size_t(way * strides[std::size_t(axis)]);
            if (body[beside] != 0 && hu[beside] > hu[i])
              density.values[i] = static_cast<float>((hu[i] - soft_tissue_hu) / 1000);
          }
      }
}

struct Bounds {
  Vector3i low, high;
};

std::optional<Bounds> bounds_of(const Density& density) {
  Bounds bounds{density.size, Vector3i::Constant(-1)};
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x)
        if (density.values[density.index(x, y, z)] != 0) {
          bounds.low = bounds.low.cwiseMin(Vector3i(x, y, z));
          bounds.high = bounds.high.cwiseMax(Vector3i(x, y, z));
        }
  if (bounds.high.x() < 0) return std::nullopt;
  return bounds;
}

/// The part within the bounds with a margin of zeros.
Density cropped(const Density& density, const Bounds& bounds) {
  Density part;
  part.hardening = density.hardening;
  part.size = bounds.high - bounds.low + Vector3i::Constant(3);
  part.model_from_voxel =
      density.model_from_voxel * Eigen::Translation3d((bounds.low - Vector3i::Ones()).cast<double>());
  part.values.assign(std::size_t(part.size.x()) * std::size_t(part.size.y()) * std::size_t(part.size.z()), 0);
  for (int z = bounds.low.z(); z <= bounds.high.z(); ++z)
    for (int y = bounds.low.y(); y <= bounds.high.y(); ++y)
      for (int x = bounds.low.x(); x <= bounds.high.x(); ++x)
        part.values[part.index(x - bounds.low.x() + 1, y - bounds.low.y() + 1, z - bounds.low.z() + 1)] =
            density.values[density.index(x, y, z)];
  return part;
}

/// Voxels on the faces of the whole grid that hold matter, about 2 mm apart.
std::vector<Vector3d> cuts_of(const Density& density) {
  std::vector<Vector3d> cuts;
  const Vector3d spacing = density.model_from_voxel.linear().colwise().norm();
  const Vector3i stride = (2 / spacing.array()).floor().cast<int>().max(1);
  for (int axis = 0; axis < 3; ++axis) {
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    for (const int face : {0, density.size[axis] - 1})
      for (int i = 0; i < density.size[p]; i += stride[p])
        for (int j = 0; j < density.size[q]; j += stride[q]) {
          Vector3i voxel;
          voxel[axis] = face, voxel[p] = i, voxel[q] = j;
          if (density.values[density.index(voxel.x(), voxel.y(), voxel.z())] > matter)
            cuts.push_back(density.model_from_voxel * voxel.cast<double>());
        }
  }
  return cuts;
}

void add_samples(Model& model, const std::vector<Vector3d>& points) {
  const double stride = std::max(1.0, double(points.size()) / double(sample_count));
  for (double at = stride / 2; at < double(points.size()); at += stride)
    model.samples.push_back(points[std::size_t(at)]);
  for (const Vector3d& point : model.samples) model.centre += point / double(model.samples.size());
  for (const Vector3d& point : model.samples)
    model.radius_mm += (point - model.centre).squaredNorm() / double(model.samples.size());
  model.radius_mm = std::sqrt(model.radius_mm);
  model.resolution_mm = std::cbrt(std::abs(model.density.model_from_voxel.linear().determinant()));
}

Expected<Model> plausible(Model model) {
  constexpr double smallest_mm = 1, largest_mm = 1000;
  if (model.radius_mm >= smallest_mm && model.radius_mm <= largest_mm) return model;
  return fail(Reason::bad_value,
              fmt::format("{}: the body's points are {:.3g} mm from its centre (rms), from {:g} to {:g} are "
                          "possible: is its file in mm?",
                          model.name, model.radius_mm, smallest_mm, largest_mm));
}

/// 1 in voxels whose centre's column, along z, is inside the surface.
Density filled(const phantom::TriangleMesh& mesh, double voxel_mm) {
  Vector3d low = mesh.corners.front(), high = low;
  for (const Vector3d& corner : mesh.corners) low = low.cwiseMin(corner), high = high.cwiseMax(corner);
  Density density;
  density.size = ((high - low) / voxel_mm).array().ceil().cast<int>() + 2;
  // Off the lattice on which designed surfaces have their corners.
  const Vector3d first = low - voxel_mm * Vector3d(0.5137, 0.4871, 0.5);
  density.model_from_voxel = Eigen::Translation3d(first) * Eigen::Scaling(voxel_mm);
  density.values.assign(
      std::size_t(density.size.x()) * std::size_t(density.size.y()) * std::size_t(density.size.z()), 0);
  std::vector<std::vector<double>> crossings(std::size_t(density.size.x()) * std::size_t(density.size.y()));
  for (const auto& triangle : mesh.triangles) {
    Vector3d c[3];
    for (std::size_t k = 0; k < 3; ++k) c[k] = (mesh.corners[triangle[k]] - first) / voxel_mm;
    const auto across = [](const Vector3d& a, const Vector3d& b, double x, double y) {
      return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
    };
    const double area = across(c[0], c[1], c[2].x(), c[2].y());
    if (area == 0) continue;
    const auto [x0, x1] = std::minmax({c[0].x(), c[1].x(), c[2].x()});
    const auto [y0, y1] = std::minmax({c[0].y(), c[1].y(), c[2].y()});
    for (int y = int(std::ceil(y0)); y <= int(std::floor(y1)); ++y)
      for (int x = int(std::ceil(x0)); x <= int(std::floor(x1)); ++x) {
        const double a = across(c[1], c[2], x, y) / area, b = across(c[2], c[0], x, y) / area;
        if (a < 0 || b < 0 || a + b > 1) continue;
        crossings[std::size_t(y) * std::size_t(density.size.x()) + std::size_t(x)].push_back(
            a * c[0].z() + b * c[1].z() + (1 - a - b) * c[2].z());
      }
  }
  for (int y = 1; y + 1 < density.size.y(); ++y)
    for (int x = 1; x + 1 < density.size.x(); ++x) {
      auto& zs = crossings[std::size_t(y) * std::size_t(density.size.x()) + std::size_t(x)];
      std::ranges::sort(zs);
      for (std::size_t k = 0; k + 1 < zs.size(); k += 2)
        for (int z = std::max(1, int(std::ceil(zs[k])));
             z <= std::min(density.size.z() - 2, int(std::floor(zs[k + 1]))); ++z)
          density.values[density.index(x, y, z)] = 1;
    }
  return density;
}

}  // namespace

Expected<void> check_mask(const std::string& name, const volume::Volume& volume, const volume::Volume& mask) {
  if (!volume::is_same_grid(mask, volume))
    return fail(Reason::bad_value,
                fmt::format("{}: the mask has {} x {} x {} voxels, the volume {} x {} x {}, or they lie "
                            "elsewhere; resample the mask to the volume",
                            name, mask.size.x(), mask.size.y(), mask.size.z(), volume.size.x(),
                            volume.size.y(), volume.size.z()));
  // A CT has few voxels that are exactly 0.
  constexpr double least_outside = 0.05;
  const auto outside = double(std::ranges::count(mask.voxels, 0.0F)) / double(mask.voxels.size());
  if (outside < least_outside)
    return fail(Reason::bad_value,
                fmt::format("{}: {:.2g} % of the mask's voxels are 0, which is outside: it is no mask", name,
                            100 * outside));
  if (outside == 1) return fail(Reason::bad_value, name + ": the mask is empty");
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0 && density_of(volume.voxels[i], true, std::nullopt, true) > matter) return {};
  return fail(Reason::bad_value, name + ": nothing within the mask is denser than soft tissue");
}

Expected<Model> model_from(const std::string& name, const volume::Volume& volume,
                           const std::optional<volume::Volume>& mask, const std::optional<HuWindow>& window) {
  if (mask)
    if (auto checked = check_mask(name, volume, *mask); !checked) return tl::unexpected(checked.error());
  Density whole{volume.size, volume.voxels, volume.patient_from_voxel};
  for (std::size_t i = 0; i < whole.values.size(); ++i)
    whole.values[i] = density_of(volume.voxels[i], !mask || mask->voxels[i] != 0, window, mask || window);
  if (mask || window) {
    add_boundary(whole, volume.voxels);
    whole.hardening = bone_hardening;
  }
  const auto bounds = bounds_of(whole);
  if (!bounds) {
    const auto [least, greatest] = std::ranges::minmax(volume.voxels);
    return fail(
        Reason::bad_value,
        fmt::format("{}: no voxel is within the mask and window; the volume's values are {:g} to {:g}", name,
                    least, greatest));
  }
  Model model;
  model.name = name;
  model.outlined = mask.has_value();
  model.cuts = cuts_of(whole);
  model.density = cropped(whole, *bounds);
  std::vector<Vector3d> points;
  for (int z = 0; z < model.density.size.z(); ++z)
    for (int y = 0; y < model.density.size.y(); ++y)
      for (int x = 0; x < model.density.size.x(); ++x)
        if (model.density.values[model.density.index(x, y, z)] > matter)
          points.push_back(model.density.model_from_voxel * Vector3d(x, y, z));
  if (points.empty())
    return fail(Reason::bad_value,
                fmt::format("{}: nothing within the mask and window is denser than soft tissue", name));
  add_samples(model, points);
  return plausible(std::move(model));
}

Expected<Model> model_from(const std::string& name, phantom::TriangleMesh mesh) {
  return prepare_surface(std::move(mesh), name).and_then([&](Surface surface) {
    Model model;
    model.name = name;
    model.voxel_mm = voxel_size_mm(surface);
    if (model.voxel_mm > 0) {
      model.cuts = flat_cut(surface);
      smooth_steps(surface, model.voxel_mm);
    }
    Vector3d low = surface.mesh.corners.front(), high = low;
    for (const Vector3d& corner : surface.mesh.corners)
      low = low.cwiseMin(corner), high = high.cwiseMax(corner);
    model.density = filled(surface.mesh, (high - low).maxCoeff() / 96);
    add_samples(model, surface.mesh.corners);
    model.surface = std::move(surface);
    return plausible(std::move(model));
  });
}

double separation(const Model& model, const geometry::RigidTransform& a, const geometry::RigidTransform& b) {
  double sum = 0;
  for (const Vector3d& point : model.samples) sum += (a * point - b * point).squaredNorm();
  return std::sqrt(sum / double(model.samples.size()));
}

}  // namespace helicarm::registration
