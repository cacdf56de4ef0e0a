// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/shape_builder.h"

#include <cmath>
#include <numbers>

#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnsignedCharArray.h>

namespace helicarm::gui {
namespace {

using Eigen::Vector3d;

constexpr int sides = 16;

}  // namespace

ShapeBuilder::ShapeBuilder() : data_(vtkSmartPointer<vtkPolyData>::New()) {
  data_->SetPoints(vtkNew<vtkPoints>());
  data_->SetPolys(vtkNew<vtkCellArray>());
  data_->SetLines(vtkNew<vtkCellArray>());
  vtkNew<vtkFloatArray> normals;
  normals->SetNumberOfComponents(3);
  data_->GetPointData()->SetNormals(normals);
  vtkNew<vtkUnsignedCharArray> colours;
  colours->SetNumberOfComponents(3);
  data_->GetPointData()->SetScalars(colours);
}

vtkIdType ShapeBuilder::add_point(const Vector3d& place, const Vector3d& normal, const Colour& colour) {
  data_->GetPointData()->GetNormals()->InsertNextTuple3(normal.x(), normal.y(), normal.z());
  data_->GetPointData()->GetScalars()->InsertNextTuple3(colour[0], colour[1], colour[2]);
  return data_->GetPoints()->InsertNextPoint(place.data());
}

void ShapeBuilder::add_triangle(vtkIdType a, vtkIdType b, vtkIdType c) {
  const vtkIdType corners[]{a, b, c};
  data_->GetPolys()->InsertNextCell(3, corners);
}

void ShapeBuilder::add_ellipsoid(const Ellipsoid& ellipsoid, const Colour& colour) {
  constexpr int rings = 8;
  vtkIdType first = 0;
  for (int ring = 0; ring <= rings; ++ring)
    for (int side = 0; side < sides; ++side) {
      const double polar = std::numbers::pi * ring / rings, azimuth = 2 * std::numbers::pi * side / sides;
      const Vector3d unit(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
                          std::cos(polar));
      const Vector3d normal = ellipsoid.axes * unit.cwiseQuotient(ellipsoid.radii.cwiseMax(1e-6));
      const vtkIdType id = add_point(ellipsoid.centre + ellipsoid.axes * unit.cwiseProduct(ellipsoid.radii),
                                     normal.normalized(), colour);
      if (ring == 0 && side == 0) first = id;
      if (ring == 0) continue;
      const vtkIdType below = first + vtkIdType{ring} * sides, above = below - sides;
      const int next = (side + 1) % sides;
      if (ring > 1) add_triangle(above + side, below + side, above + next);
      if (ring < rings) add_triangle(above + next, below + side, below + next);
    }
}

void ShapeBuilder::add_ball(const Vector3d& centre, double radius_mm, const Colour& colour) {
  add_ellipsoid({centre, Eigen::Matrix3d::Identity(), Vector3d::Constant(radius_mm)}, colour);
}

void ShapeBuilder::add_tube(const Segment& axis, double from_radius_mm, double to_radius_mm,
                            const Colour& colour) {
  const Vector3d along = axis.to - axis.from;
  if (along.norm() < 1e-6) return;
  const Vector3d z = along.normalized(), x = z.unitOrthogonal(), y = z.cross(x);
  const double slope = (from_radius_mm - to_radius_mm) / along.norm();
  const vtkIdType from = add_point(axis.from, -z, colour), to = add_point(axis.to, z, colour);
  const vtkIdType first = to + 1;
  for (int side = 0; side < sides; ++side) {
    const double azimuth = 2 * std::numbers::pi * side / sides;
    const Vector3d out = std::cos(azimuth) * x + std::sin(azimuth) * y;
    const Vector3d normal = (out + slope * z).normalized();
    add_point(axis.from + from_radius_mm * out, normal, colour);
    add_point(axis.to + to_radius_mm * out, normal, colour);
    add_point(axis.from + from_radius_mm * out, -z, colour);
    add_point(axis.to + to_radius_mm * out, z, colour);
    const vtkIdType here = first + vtkIdType{4} * side, next = first + vtkIdType{4} * ((side + 1) % sides);
    add_triangle(here, next, here + 1);
    add_triangle(here + 1, next, next + 1);
    add_triangle(from, next + 2, here + 2);
    add_triangle(to, here + 3, next + 3);
  }
}

void ShapeBuilder::add_mesh(const phantom::TriangleMesh& mesh, const Colour& colour) {
  std::vector<Vector3d> normals(mesh.corners.size(), Vector3d::Zero());
  const vtkIdType first = data_->GetNumberOfPoints();
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3d normal = (mesh.corners[b] - mesh.corners[a])
                                .cross(mesh.corners[c] - mesh.corners[a]);  // length proportional to the area
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += normal;
    add_triangle(first + a, first + b, first + c);
  }
  for (std::size_t i = 0; i < normals.size(); ++i)
    add_point(mesh.corners[i], normals[i].normalized(), colour);
}

void ShapeBuilder::add_line(std::span<const Vector3d> places, const Colour& colour, bool closed) {
  if (places.size() < 2) return;
  const vtkIdType first = data_->GetNumberOfPoints();
  data_->GetLines()->InsertNextCell(int(places.size()) + closed);
  for (const Vector3d& place : places)
    data_->GetLines()->InsertCellPoint(add_point(place, Vector3d::UnitZ(), colour));
  if (closed) data_->GetLines()->InsertCellPoint(first);
}

void ShapeBuilder::add_slice(const TreSlice& slice, const TreScale& scale) {
  const vtkIdType first = data_->GetNumberOfPoints();
  for (std::size_t i = 0; i < slice.places.size(); ++i) {
    const double value = slice.rms_mm[i];
    add_point(slice.places[i], Vector3d::UnitZ(),
              std::isfinite(value) ? colour_of(scale.share(value)) : Colour{});
  }
  for (int row = 0; row + 1 < slice.side; ++row)
    for (int column = 0; column + 1 < slice.side; ++column) {
      const int a = row * slice.side + column, b = a + 1, c = a + slice.side, d = c + 1;
      bool known = true;
      for (const int corner : {a, b, c, d}) known = known && std::isfinite(slice.rms_mm[std::size_t(corner)]);
      if (!known) continue;
      add_triangle(first + a, first + b, first + d);
      add_triangle(first + a, first + d, first + c);
    }
}

}  // namespace helicarm::gui
