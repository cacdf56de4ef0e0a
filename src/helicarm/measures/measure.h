// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/measures/kinds.h"
#include "helicarm/measures/object_plane.h"

namespace helicarm::measures {

/// A click or another point of the image. The name is a role's word, or that of a further point.
struct Click {
  std::string name;
  Eigen::Vector2d uv;              ///< px, rectified where the view is
  Eigen::Matrix2d covariance_px2;  ///< zero: exact
};

/// A number with its standard deviation.
struct Quantity {
  std::string name;
  std::string unit;  ///< "mm", "px" or "deg"
  double value;
  std::optional<double> sigma;  ///< nothing: it is itself a measure of error
};

/// Where a point lies, per cent of the landmarks' distances.
struct Position {
  std::string point;
  Eigen::VectorXd percent;     ///< by the kind's components
  Eigen::MatrixXd covariance;  ///< of the point's and the landmarks' errors
  /// outside_reference: outside 0 to 100 % by more than the 95 % error; far outside it names the clicks whose
  /// exchange gives a position inside.
  std::vector<Warning> warnings = {};
};

struct Measure {
  Kind kind;
  std::vector<Quantity> quantities;
  std::vector<Position> positions = {};
  std::optional<double> depth_mm = {};  ///< of the plane in which lengths are given; nothing: lengths in px
};

/// Measures in the object plane, without one in pixels. Angles and per cent are those of the projection; they
/// need no plane, except where pixels are not square. Points and landmarks of different depth are magnified
/// differently, as in the publications; this is not in the covariances. The clicks' errors are taken as
/// independent.
/// Refuses (bad_value) clicks that lack a role of the kind, give one twice or have names that it does not
/// take, clicks that do not determine the measure, e.g. a circle through points on a line, and exchanged
/// landmarks where others contradict them.
Expected<Measure> measure(Kind kind, std::span<const Click> clicks, const std::optional<ObjectPlane>& plane);

/// The image of a point of the calibrator's frame, with its covariance carried through the view, which is
/// taken as exact. `behind_source` where there is none.
Expected<Click> click_of(const std::string& name, const Eigen::Vector3d& point,
                         const Eigen::Matrix3d& covariance_mm2, const geometry::View& view);
}  // namespace helicarm::measures
