// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/cut_plane.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/small_matrix.h"

namespace helicarm::registration {

using Eigen::Vector3d;

namespace {

constexpr float part_matter = 0.1F;  // least density that is of a body, as in model.cc
constexpr std::size_t part_samples = 60;

/// Calls `take(point, value)` for what is not empty; the value may be changed.
template <class AnyDensity, class Take>
void for_each_voxel(AnyDensity& density, const Take& take) {
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x)
        if (auto& value = density.values[density.index(x, y, z)]; value != 0)
          take(density.model_from_voxel * Eigen::Vector3d(x, y, z), value);
}

}  // namespace

std::vector<CutAxis> cut_axes_of(const Model& model) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& sample : model.samples)
    spread += (sample - model.centre) * (sample - model.centre).transpose();
  std::vector<CutAxis> axes{{model.centre, geometry::symmetric_eigen<3>(spread).vectors.col(2)}};
  for (int i = 0; i < 3; ++i) axes.push_back({model.centre, Vector3d::Unit(i)});
  return axes;
}

void measure_ends(const Model& model, std::vector<CutAxis>& axes) {
  for_each_voxel(model.density, [&](const Vector3d& point, float value) {
    if (value <= part_matter) return;
    for (CutAxis& axis : axes) {
      axis.low = std::min(axis.low, axis.at(point));
      axis.high = std::max(axis.high, axis.at(point));
    }
  });
}

std::optional<Division> divided(const Model& model, const CutPlane& plane) {
  struct Sum {
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    void add(const Vector3d& point) {
      sum += point;
      ++count;
    }
    Vector3d mean() const { return sum / count; }
  } section, lower, upper;
  const double voxel_mm = model.density.model_from_voxel.linear().colwise().norm().maxCoeff();
  for_each_voxel(model.density, [&](const Vector3d& point, float value) {
    if (value <= part_matter) return;
    const double from_plane = plane.from(point);
    (from_plane > 0 ? upper : lower).add(point);
    if (std::abs(from_plane) < voxel_mm) section.add(point);
  });
  if (section.count == 0 || lower.count == 0 || upper.count == 0) return std::nullopt;
  return Division{section.mean(), lower.mean(), upper.mean()};
}

std::optional<Model> part_beyond(const Model& model, const CutPlane& plane, bool upper) {
  Model part = model;
  std::vector<Vector3d> points;
  const double voxel_mm = model.density.model_from_voxel.linear().colwise().norm().maxCoeff();
  std::erase_if(part.cuts, [&](const Vector3d& point) { return (plane.from(point) > 0) != upper; });
  for_each_voxel(part.density, [&](const Vector3d& point, float& value) {
    const double from_plane = plane.from(point);
    if ((from_plane > 0) != upper) {
      value = 0;
      return;
    }
    if (value <= part_matter) return;
    points.push_back(point);
    if (std::abs(from_plane) < voxel_mm) part.cuts.push_back(point);
  });
  if (points.size() < part_samples) return std::nullopt;
  part.samples.clear();
  part.centre.setZero();
  const double stride = double(points.size()) / double(part_samples);
  for (std::size_t i = 0; i < part_samples; ++i)
    part.samples.push_back(points[std::size_t((double(i) + 0.5) * stride)]);
  for (const Vector3d& sample : part.samples) part.centre += sample / double(part_samples);
  double squares = 0;
  for (const Vector3d& sample : part.samples) squares += (sample - part.centre).squaredNorm();
  part.radius_mm = std::sqrt(squares / double(part_samples));
  return part;
}

double turn_between_deg(const geometry::RigidTransform& one, const geometry::RigidTransform& other) {
  return Eigen::AngleAxisd(one.rotation.transpose() * other.rotation).angle() * 180 / EIGEN_PI;
}

std::vector<std::vector<Along>> agreements_along(const CutAxis& axis,
                                                 const std::vector<RegistrationView>& views,
                                                 const Registration& found, double largest_cosine) {
  const Vector3d direction = found.world_from_model.rotation * axis.direction;
  std::vector<std::vector<Along>> all;
  for (std::size_t i = 0; i < views.size() && i < found.views.size(); ++i) {
    const geometry::View& view = views[i].view;
    const Vector3d to_centre = found.centre - view.source_in_world();
    if (std::abs(direction.dot(to_centre.normalized())) > largest_cosine) return {};
    std::vector<Along>& own = all.emplace_back();
    for (const LocalAgreement& each : found.views[i].agreements) {
      const geometry::Ray ray = geometry::ray_through(view, each.pixel);
      const Vector3d at =
          ray.origin + ray.direction * (to_centre.squaredNorm() / ray.direction.dot(to_centre));
      own.push_back({direction.dot(at - found.centre), each.agreement, each.weight});
    }
  }
  return all;
}

}  // namespace helicarm::registration
