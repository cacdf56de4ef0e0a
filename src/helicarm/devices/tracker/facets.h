// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm {

/// A tracked pattern on one side of the calibrator.
struct Facet {
  std::string name;
  RigidTransform calibrator_from_facet;
};

struct FacetPose {
  std::string name;
  RigidTransform tracker_from_facet;
  PoseCovariance covariance;
};

struct FacetsOptions {
  double body_mm = 0.05;   ///< how exactly a facet sits on the body, per axis: a printed part's tolerance
  double body_deg = 0.05;  ///< the same over a facet of 60 mm
};

struct FusedPose {
  RigidTransform tracker_from_calibrator;
  PoseCovariance covariance;  ///< about the calibrator's origin
  std::vector<std::string> used;
  std::vector<std::string> thrown_out;
  double chi2 = 0;  ///< 6 (used - 1) degrees of freedom
};

/// The calibrator's pose from those of its facets that are seen, by weighted least squares; one is enough.
/// Where they disagree (99.9 %), one of three or more may be thrown out. Refuses: none seen (`no_pose`), a
/// disagreement that does not say which is wrong (`residual_too_large`), an unknown name (`bad_value`), a
/// name twice (`name_clash`).
Expected<FusedPose> fuse_facets(std::span<const Facet> facets, std::span<const FacetPose> seen,
                                const FacetsOptions& options = {});

}  // namespace helicarm
