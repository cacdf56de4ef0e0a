// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include "gui/scene/scene_values.h"
#include "gui/scene/tre_slice.h"

namespace helicarm::gui {

/// Collects coloured shapes into one VTK surface, to draw many by one call.
class ShapeBuilder {
 public:
  ShapeBuilder();

  void add_ellipsoid(const Ellipsoid& ellipsoid, const Colour& colour);
  void add_ball(const Eigen::Vector3d& centre, double radius_mm, const Colour& colour);
  /// A truncated cone along the segment with closed ends.
  void add_tube(const Segment& axis, double from_radius_mm, double to_radius_mm, const Colour& colour);
  /// Smoothly shaded: normals are means over the adjacent triangles.
  void add_mesh(const phantom::TriangleMesh& mesh, const Colour& colour);
  void add_line(std::span<const Eigen::Vector3d> places, const Colour& colour, bool closed = false);
  /// Cells with a corner of unknown error are left out.
  void add_slice(const TreSlice& slice, const TreScale& scale);

  vtkSmartPointer<vtkPolyData> build() const { return data_; }

 private:
  vtkIdType add_point(const Eigen::Vector3d& place, const Eigen::Vector3d& normal, const Colour& colour);
  void add_triangle(vtkIdType a, vtkIdType b, vtkIdType c);

  vtkSmartPointer<vtkPolyData> data_;
};

}  // namespace helicarm::gui
