// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/broken_bone.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/small_matrix.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

// Comparisons of a view on either side: those beside the plane do not count in a part, and at least 8 must.
constexpr int least_part_comparisons = 16;
constexpr double least_difference = 0.15;  // of the sides' agreement in a view: less is not worth the time
// Of the axis (30 degrees from the image's plane): beyond, the cut hides much of what lies beside it.
constexpr double largest_cosine_to_ray = 0.5;
constexpr double plane_step_mm = 2;
constexpr float part_matter = 0.1F;  // least density that is of a body, as in model.cc
constexpr std::size_t part_samples = 60;
// Parts of one piece were up to 1.7 mm apart: a shaft turns about itself.
constexpr double least_moved_mm = 2.5;
constexpr double least_moved_errors = 1.5;  // of both parts' 95 % errors together

/// An axis of a model through its centre.
struct CutAxis {
  Vector3d centre, direction;
  double low = 0, high = 0;  ///< ends, mm from the centre

  double at(const Vector3d& point) const { return direction.dot(point - centre); }
};

/// Calls `take(point, value)` for what is not empty; the value may be changed.
template <class AnyDensity, class Take>
void for_each_voxel(AnyDensity& density, const Take& take) {
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x)
        if (auto& value = density.values[density.index(x, y, z)]; value != 0)
          take(density.model_from_voxel * Vector3d(x, y, z), value);
}

/// Along which a bone may be cut: its longest one and those of the model's coordinates, one of which often is
/// the shaft's; the longest one of a bone's wide end is not.
std::vector<CutAxis> cut_axes_of(const Model& model) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& sample : model.samples)
    spread += (sample - model.centre) * (sample - model.centre).transpose();
  std::vector<CutAxis> axes{{model.centre, geometry::symmetric_eigen<3>(spread).vectors.col(2)}};
  for (int i = 0; i < 3; ++i) axes.push_back({model.centre, Vector3d::Unit(i)});
  for_each_voxel(model.density, [&](const Vector3d& point, float value) {
    if (value <= part_matter) return;
    for (CutAxis& axis : axes) {
      axis.low = std::min(axis.low, axis.at(point));
      axis.high = std::max(axis.high, axis.at(point));
    }
  });
  return axes;
}

/// A comparison's place along the axis, taken at the depth of the model's centre.
struct Along {
  double at_mm, agreement;
};

/// Of each view; nothing where one does not show places along the axis.
std::vector<std::vector<Along>> agreements_along(const CutAxis& axis,
                                                 const std::vector<RegistrationView>& views,
                                                 const Registration& found) {
  const Vector3d direction = found.world_from_model.rotation * axis.direction;
  std::vector<std::vector<Along>> all;
  for (std::size_t i = 0; i < views.size() && i < found.views.size(); ++i) {
    const geometry::View& view = views[i].view;
    const Vector3d to_centre = found.centre - view.source_in_world();
    if (std::abs(direction.dot(to_centre.normalized())) > largest_cosine_to_ray) return {};
    std::vector<Along>& own = all.emplace_back();
    for (const LocalAgreement& each : found.views[i].agreements) {
      const geometry::Ray ray = geometry::ray_through(view, each.pixel);
      const Vector3d at =
          ray.origin + ray.direction * (to_centre.squaredNorm() / ray.direction.dot(to_centre));
      own.push_back({direction.dot(at - found.centre), each.agreement});
    }
  }
  return all;
}

/// Variance between the agreements on both sides of a plane, summed over the views; nothing where a side has
/// too few or the sides are alike.
std::optional<double> variance_between(const std::vector<std::vector<Along>>& views, double plane_mm) {
  double between = 0;
  bool is_different = false;
  for (const std::vector<Along>& view : views) {
    double sums[2] = {0, 0};
    int counts[2] = {0, 0};
    for (const Along& each : view) {
      sums[each.at_mm > plane_mm] += each.agreement;
      ++counts[each.at_mm > plane_mm];
    }
    if (std::min(counts[0], counts[1]) < least_part_comparisons) return std::nullopt;
    const double n = counts[0] + counts[1];
    const double difference = sums[0] / counts[0] - sums[1] / counts[1];
    is_different = is_different || std::abs(difference) >= least_difference;
    between += counts[0] / n * counts[1] / n * difference * difference;
  }
  return is_different ? std::optional(between) : std::nullopt;
}

struct CutPlane {
  CutAxis axis;
  double at_mm = 0;

  double from(const Vector3d& point) const { return axis.at(point) - at_mm; }
};

/// The plane that separates what agrees from what does not best.
std::optional<CutPlane> separating_plane(const Model& model, const std::vector<RegistrationView>& views,
                                         const Registration& found) {
  std::optional<CutPlane> best;
  double largest = 0;
  for (const CutAxis& axis : cut_axes_of(model)) {
    const auto along = agreements_along(axis, views, found);
    if (along.empty()) continue;
    for (double plane = axis.low; plane < axis.high; plane += plane_step_mm)
      if (const auto between = variance_between(along, plane); between && *between > largest) {
        best = {axis, plane};
        largest = *between;
      }
  }
  return best;
}

/// What of a model lies on one side of a plane across its axis; at the plane it goes on.
std::optional<Model> part_of(const Model& model, const CutPlane& cut, bool beyond) {
  Model part = model;
  std::vector<Vector3d> points;
  const double voxel_mm = model.density.model_from_voxel.linear().colwise().norm().maxCoeff();
  std::erase_if(part.cuts, [&](const Vector3d& point) { return (cut.from(point) > 0) != beyond; });
  for_each_voxel(part.density, [&](const Vector3d& point, float& value) {
    const double from_plane = cut.from(point);
    if ((from_plane > 0) != beyond) {
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

}  // namespace

std::optional<BrokenBone> broken_bone(const Model& model, const std::vector<RegistrationView>& views,
                                      const Registration& refused, const RegisterPart& register_part) {
  if (model.surface || views.size() < 2) return std::nullopt;
  const auto plane = separating_plane(model, views, refused);
  if (!plane) return std::nullopt;
  const auto& [axis, at_mm] = *plane;
  const bool is_upper_shorter = axis.high - at_mm < at_mm - axis.low;
  // One part after the other: each is as large as the model.
  std::optional<Model> part = part_of(model, *plane, !is_upper_shorter);
  if (!part) return std::nullopt;
  const Registration one = register_part(*part, refused.world_from_model);
  if (one.failure) return std::nullopt;
  const double error_of_longer_mm = worst_error_mm(*part, one);
  part = part_of(model, *plane, is_upper_shorter);
  if (!part) return std::nullopt;
  const Registration other = register_part(*part, one.world_from_model);
  if (other.failure) return std::nullopt;
  BrokenBone broken;
  broken.moved_mm = separation(*part, one.world_from_model, other.world_from_model);
  const double error_mm = std::hypot(error_of_longer_mm, worst_error_mm(*part, other));
  if (broken.moved_mm < std::max(least_moved_mm, least_moved_errors * error_mm)) return std::nullopt;
  const Eigen::AngleAxisd turn(one.world_from_model.rotation.transpose() * other.world_from_model.rotation);
  broken.turned_deg = turn.angle() * 180 / EIGEN_PI;
  const double end = is_upper_shorter ? axis.high : axis.low;
  broken.cut = axis.centre + at_mm * axis.direction;
  broken.end = axis.centre + end * axis.direction;
  broken.from_end_mm = std::abs(end - at_mm);
  return broken;
}

}  // namespace helicarm::registration
