// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

/// A tracked marker pattern on one side of the calibrator.
struct Facet {
  std::string name;
  geometry::RigidTransform calibrator_from_facet;
  double sigma_mm =
      0;  ///< of the mount per axis, by `calibrate_mount`; at least that of FacetsOptions is used
  double sigma_deg = 0;
};

struct FacetPose {
  std::string name;
  geometry::RigidTransform tracker_from_facet;
  PoseCovariance covariance;
};

struct FacetsOptions {
  double body_mm = 0.05;   ///< position tolerance of a facet on the body per axis: a printed part's
  double body_deg = 0.05;  ///< rotation tolerance, for a facet of 60 mm
};

struct FusedPose {
  geometry::RigidTransform tracker_from_calibrator;
  PoseCovariance covariance;  ///< about the calibrator's origin
  std::vector<std::string> used;
  std::vector<std::string> thrown_out;
  double chi2 = 0;  ///< 6 (used - 1) degrees of freedom
};

/// The calibrator's pose from those of its visible facets, by weighted least squares; one is enough. If they
/// are inconsistent (99.9 %), one of three or more can be rejected. Refuses: none visible (`no_pose`), an
/// inconsistency without a unique outlier (`residual_too_large`), an unknown name (`bad_value`), a duplicate
/// name (`name_clash`).
Expected<FusedPose> fuse_facets(std::span<const Facet> facets, std::span<const FacetPose> seen,
                                const FacetsOptions& options = {});

}  // namespace helicarm::tracker
