// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/case_registration/plan.h"
#include "helicarm/image/image.h"
#include "helicarm/registration/bone_check.h"
#include "helicarm/registration/bone_surface.h"

namespace helicarm::case_registration {

/// A plane through a model's files. Pixel (u, v): the middle plus u and v steps from the image's middle.
struct TunnelSlice {
  image::Image<std::uint8_t> grey;                    ///< of the CT, or of the inside of a surface
  std::vector<std::vector<Eigen::Vector2d>> outline;  ///< of the bone: closed curves, px
  Eigen::Vector2d start = Eigen::Vector2d::Zero();    ///< of the tunnel's axis, px
  Eigen::Vector2d end = Eigen::Vector2d::Zero();      ///< the same point in the plane across it
  Eigen::Vector2d thinnest =
      Eigen::Vector2d::Zero();  ///< where its wall is nearest to the bone's surface, px
};

/// A tunnel in the CT before any registration: along its axis through the thinnest place of the bone beside
/// it, along it at a right angle to that, and across it at that place.
struct TunnelSlices {
  std::array<TunnelSlice, 3> slices;
  double pixel_mm = 0;
};

/// Of each tunnel of the plan, in its order; nothing where `checks` has nothing. `ct`: null for a surface.
std::vector<std::optional<TunnelSlices>> tunnel_slices(
    const MarkupPlan& plan, const std::vector<std::optional<registration::BoneCheck>>& checks,
    const registration::BoneSurface& bone, const volume::Volume* ct);

/// The three slices side by side with the tunnel's walls: red where it is a breach, yellow where it is thin,
/// else green. PNG.
std::string tunnel_slices_png(const TunnelSlices& slices, const registration::BoneCheck& check);

}  // namespace helicarm::case_registration
