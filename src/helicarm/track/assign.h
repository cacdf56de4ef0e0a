// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/track/marker_image.h"

namespace helicarm::track {

/// What is expected of a marker in one view.
struct ExpectedImage {
  double radius_px = 0;
  ContrastModel contrast = {};  ///< its spread is that of the contrast's logarithm
  double visible = 0;           ///< absolute contrast when it was seen last; 0: unknown
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< by the camera's delay
  double shift_sigma = 0;                              ///< of it, px
};

/// Where a marker is expected, world, mm.
struct ExpectedMarker {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  std::vector<ExpectedImage> images;  ///< per view
};

/// A disc with its place in rectified pixels.
struct Candidate {
  MarkerImage image;
  Eigen::Vector2d uv;
};

constexpr int not_seen = -1;

/// For each marker and view the index of its disc, or `not_seen`: the assignment of all markers to all discs
/// with the largest likelihood, in which no disc serves twice. A marker's discs must agree with one place in
/// space near the expected one (their ray gap is part of it), with its contrast and its size; a disc of no
/// marker, and a marker that is hidden, have a price.
std::vector<std::vector<int>> assign(std::span<const geometry::View> views,
                                     std::span<const ExpectedMarker> markers,
                                     std::span<const std::vector<Candidate>> discs);

}  // namespace helicarm::track
