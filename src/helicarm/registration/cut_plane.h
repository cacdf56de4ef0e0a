// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

/// An axis of a model through its centre; model coordinates.
struct CutAxis {
  Eigen::Vector3d centre, direction;
  double low = 0, high = 0;  ///< ends, mm from the centre

  double at(const Eigen::Vector3d& point) const { return direction.dot(point - centre); }
};

/// A plane across an axis.
struct CutPlane {
  CutAxis axis;
  double at_mm = 0;  ///< from the centre

  double from(const Eigen::Vector3d& point) const { return axis.at(point) - at_mm; }
  Eigen::Vector3d middle() const { return axis.centre + at_mm * axis.direction; }
  double end_mm(bool upper) const { return upper ? axis.high : axis.low; }
  Eigen::Vector3d end(bool upper) const { return axis.centre + end_mm(upper) * axis.direction; }
};

inline constexpr double plane_step_mm = 2;  ///< between planes that are tried

/// Along which a bone may be cut: its longest one and those of the model's coordinates, one of which often is
/// the shaft's; the longest one of a bone's wide end is not. Without ends.
std::vector<CutAxis> cut_axes_of(const Model& model);

/// Sets the ends of axes to those of a model.
void measure_ends(const Model& model, std::vector<CutAxis>& axes);

/// Centres of what lies near a plane and on its sides; model coordinates.
struct Division {
  Eigen::Vector3d section, lower, upper;
};

/// Nothing where one of them is empty.
std::optional<Division> divided(const Model& model, const CutPlane& plane);

/// What of a model lies on one side of a plane, with a centre and samples of its own; at the plane the body
/// goes on. Nothing where hardly anything lies there.
std::optional<Model> part_beyond(const Model& model, const CutPlane& plane, bool upper);

/// Registers a part of a model from a pose near it.
using RegisterPart =
    std::function<Registration(const Model& part, const geometry::RigidTransform& world_from_model)>;

double turn_between_deg(const geometry::RigidTransform& one, const geometry::RigidTransform& other);

/// A comparison's place along an axis, taken at the depth of the model's centre.
struct Along {
  double at_mm, agreement, weight;
};

/// Of each view, at the pose found; nothing where the axis is nearer to a view's ray than by this cosine: the
/// image then hardly shows places along it.
std::vector<std::vector<Along>> agreements_along(const CutAxis& axis,
                                                 const std::vector<RegistrationView>& views,
                                                 const Registration& found, double largest_cosine);

}  // namespace helicarm::registration
