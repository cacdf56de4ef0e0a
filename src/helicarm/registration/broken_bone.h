// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/registration/cut_plane.h"

namespace helicarm::registration {

/// A body whose two parts lie in the images otherwise than in its CT.
struct BrokenBone {
  Eigen::Vector3d cut =
      Eigen::Vector3d::Zero();  ///< between the parts, on the axis that is cut; model coordinates
  Eigen::Vector3d end = Eigen::Vector3d::Zero();  ///< the nearer end of that axis
  double from_end_mm = 0;                         ///< of the cut, along the axis
  double moved_mm = 0;  ///< of the shorter part against the other: rms over its samples
  double turned_deg = 0;
};

/// Whether a volume that no single pose explains in two or more views is explained by two: the agreements
/// differ most on the two sides of a plane across its longest axis or one of its coordinates', and each part
/// alone is registered (not refused), at another pose than the other.
std::optional<BrokenBone> broken_bone(const Model& model, const std::vector<RegistrationView>& views,
                                      const Registration& refused, const RegisterPart& register_part);

}  // namespace helicarm::registration
