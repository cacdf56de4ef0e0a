// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/geometry/view.h"

namespace helicarm::volume {

/// A flat square detector perpendicular to the central ray, on an orbit about a point of the patient.
struct DrrGeometry {
  int size = 1024;  ///< pixels per side
  double pixel_mm = 0.29;
  double source_detector_mm = 1020;
  double source_centre_mm = 700;
  double angle_deg = 0;  ///< position of the source: 0 anterior, 90 at the patient's left
  double tilt_deg = 0;   ///< of the source towards the head

  bool operator==(const DrrGeometry&) const = default;
};

/// Patient frame (L, P, S; mm) to pixels; `centre` lies on the central ray. Rows run from head to foot; at
/// angle 0 the patient's left is on the right.
geometry::View drr_view(const DrrGeometry& geometry, const Eigen::Vector3d& centre);

}  // namespace helicarm::volume
