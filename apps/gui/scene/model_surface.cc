// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/model_surface.h"

#include <algorithm>
#include <cmath>

#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkQuadricClustering.h>

namespace helicarm::gui {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using phantom::TriangleMesh;
using registration::Density;

TriangleMesh mesh_of(vtkPolyData& data) {
  TriangleMesh mesh;
  mesh.corners.resize(std::size_t(data.GetNumberOfPoints()));
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) data.GetPoint(vtkIdType(i), mesh.corners[i].data());
  vtkIdType count = 0;
  const vtkIdType* corners = nullptr;
  vtkCellArray* polygons = data.GetPolys();
  for (polygons->InitTraversal(); polygons->GetNextCell(count, corners) != 0;)
    if (count == 3)
      mesh.triangles.push_back(
          {std::uint32_t(corners[0]), std::uint32_t(corners[1]), std::uint32_t(corners[2])});
  return mesh;
}

/// Half the mean of the voxels that hold matter.
float half_of_mean(const Density& density) {
  double sum = 0;
  std::size_t count = 0;
  for (const float value : density.values)
    if (value > 0.1F) sum += double(value), ++count;
  return count > 0 ? float(0.5 * sum / double(count)) : 0;
}

/// Gives voxels between `low` and `high` that are below `level` and cannot be reached from `low` the level's
/// double.
void fill_enclosed(Density& density, float level, const Vector3i& low, const Vector3i& high) {
  std::vector<std::uint8_t> outside(density.values.size(), 0);
  const auto index = [&](const Vector3i& voxel) { return density.index(voxel.x(), voxel.y(), voxel.z()); };
  std::vector<Vector3i> front{low};
  outside[index(low)] = 1;
  while (!front.empty()) {
    const Vector3i voxel = front.back();
    front.pop_back();
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        Vector3i next = voxel;
        next[axis] += step;
        if (next[axis] < low[axis] || next[axis] > high[axis]) continue;
        const std::size_t at = index(next);
        if (outside[at] != 0 || density.values[at] >= level) continue;
        outside[at] = 1;
        front.push_back(next);
      }
  }
  for (int z = low.z(); z <= high.z(); ++z)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int x = low.x(); x <= high.x(); ++x) {
        const std::size_t at = density.index(x, y, z);
        if (outside[at] == 0 && density.values[at] < level) density.values[at] = 2 * level;
      }
}

/// Fills cavities, also a marrow cavity that opens where the volume or its mask cuts the bone: there the two
/// outermost slices are closed first. The outermost voxels are zero.
void fill_cavities(Density& density, float level) {
  constexpr int cap = 2;
  const Vector3i last = density.size - Vector3i::Ones();
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 1; i <= cap && i < last[axis]; ++i)
      for (const int slice : {i, last[axis] - i}) {
        Vector3i low = Vector3i::Zero(), high = last;
        low[axis] = high[axis] = slice;
        fill_enclosed(density, level, low, high);
      }
  fill_enclosed(density, level, Vector3i::Zero(), last);
}

TriangleMesh isosurface(const Density& density, float level) {
  vtkNew<vtkFloatArray> values;
  values->SetNumberOfValues(vtkIdType(density.values.size()));
  std::ranges::copy(density.values, values->GetPointer(0));
  vtkNew<vtkImageData> image;
  image->SetDimensions(density.size.x(), density.size.y(), density.size.z());
  image->GetPointData()->SetScalars(values);
  vtkNew<vtkFlyingEdges3D> edges;
  edges->SetInputData(image);
  edges->SetValue(0, double(level));
  edges->ComputeNormalsOff();
  edges->ComputeScalarsOff();
  edges->Update();
  TriangleMesh mesh = mesh_of(*edges->GetOutput());
  for (Vector3d& corner : mesh.corners) corner = density.model_from_voxel * corner;
  return mesh;
}

void turn_outside_out(TriangleMesh& mesh) {
  if (phantom::volume(mesh) < 0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

TriangleMesh surface_of_density(const Density& given) {
  constexpr double most_voxels = 1e6;
  const float level = half_of_mean(given);
  double voxel_mm = std::cbrt(std::abs(given.model_from_voxel.linear().determinant()) *
                              std::max(1.0, double(given.values.size()) / most_voxels));
  for (;;) {
    Density density = registration::coarser(given, voxel_mm);
    fill_cavities(density, level);
    TriangleMesh mesh = isosurface(density, level);
    if (mesh.triangles.size() <= most_model_triangles) {
      turn_outside_out(mesh);
      return mesh;
    }
    // By whole voxels: at least to the next number of them.
    voxel_mm *= std::max(1.5, 1.1 * std::sqrt(double(mesh.triangles.size()) / most_model_triangles));
  }
}

/// Corners in one cell of a grid become one (Lindstrom 2000).
TriangleMesh clustered(const TriangleMesh& given) {
  Eigen::AlignedBox3d box;
  double area = 0;
  vtkNew<vtkPolyData> data;
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> polygons;
  for (const Vector3d& corner : given.corners) {
    box.extend(corner);
    points->InsertNextPoint(corner.data());
  }
  for (const auto& [a, b, c] : given.triangles) {
    const Vector3d across = (given.corners[b] - given.corners[a]).cross(given.corners[c] - given.corners[a]);
    area += across.norm() / 2;
    const vtkIdType corners[]{a, b, c};
    polygons->InsertNextCell(3, corners);
  }
  data->SetPoints(points);
  data->SetPolys(polygons);
  // A cell of a surface's grid gives about two triangles; cells that the surface cuts obliquely, more.
  for (double cell_mm = std::sqrt(3 * area / most_model_triangles);; cell_mm *= 1.2) {
    const Eigen::Vector3i cells = (box.sizes() / cell_mm).array().ceil().cast<int>().max(1);
    vtkNew<vtkQuadricClustering> clustering;
    clustering->SetInputData(data);
    clustering->AutoAdjustNumberOfDivisionsOff();
    clustering->SetNumberOfDivisions(cells.x(), cells.y(), cells.z());
    clustering->Update();
    TriangleMesh mesh = mesh_of(*clustering->GetOutput());
    if (mesh.triangles.size() <= most_model_triangles) return mesh;
  }
}

}  // namespace

TriangleMesh surface_of(const registration::Model& model) {
  if (!model.surface) return surface_of_density(model.density);
  const TriangleMesh& mesh = model.surface->mesh;
  return mesh.triangles.size() > most_model_triangles ? clustered(mesh) : mesh;
}

ModelSurfaces::ModelSurfaces(QObject* parent) : QObject(parent) { pool_.setMaxThreadCount(1); }

void ModelSurfaces::keep(const std::vector<Model>& models) {
  std::erase_if(surfaces_,
                [&](const auto& one) { return std::ranges::find(models, one.first) == models.end(); });
  for (const Model& model : models) {
    if (!model || !surfaces_.emplace(model, nullptr).second) continue;
    pool_.start([this, wanted = std::weak_ptr(model)] {
      const Model of = wanted.lock();
      if (!of) return;  // forgotten since
      auto surface = std::make_shared<const TriangleMesh>(surface_of(*of));
      QMetaObject::invokeMethod(
          this,
          [this, wanted, surface] {
            const auto one = surfaces_.find(wanted.lock());
            if (one == surfaces_.end()) return;
            one->second = surface;
            emit computed();
          },
          Qt::QueuedConnection);
    });
  }
}

ModelSurfaces::Surface ModelSurfaces::of(const Model& model) const {
  const auto one = surfaces_.find(model);
  return one == surfaces_.end() ? nullptr : one->second;
}

}  // namespace helicarm::gui
