// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "helicarm/phantom/mesh.h"

namespace helicarm::registration {

/// A tip of a surface.
struct ProminentPoint {
  Eigen::Vector3d place;  ///< a corner of the mesh
  /// How much less than a half of the surroundings the body fills: 0 of a plane, 0.5 of a needle's tip; of
  /// mean curvature H (1/mm) about 0.3 `ball_mm` H.
  double prominence = 0;
};

struct ProminentOptions {
  std::size_t most = 6;
  /// Size of the surroundings: Gaussians of half and of this standard deviation, whose mean counts. At most a
  /// quarter of the body's radius (rms).
  double ball_mm = 8;
  double apart_mm = 20;  ///< least distance of two points; at most 0.6 of the body's radius (rms)
};

/// The points of a closed surface that stand out most, the most prominent first: local maxima of an integral
/// invariant (Manay et al. 2006, Pottmann et al. 2009), the share of the volume about a point that the body
/// fills, at least 1.5 times its median over the surface. The third lies beside the line of the first two
/// where one does, as landmarks must. `cuts`, mm: where the body goes on beyond its volume or surface
/// (`Model::cuts`); none is near one or an open edge. Linear in the number of triangles.
std::vector<ProminentPoint> prominent_points(const phantom::TriangleMesh& mesh,
                                             const std::vector<Eigen::Vector3d>& cuts = {},
                                             const ProminentOptions& options = {});

}  // namespace helicarm::registration
