// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "helicarm/guidance/bone_check.h"

namespace helicarm::registration {

class BoneSurface;

/// A planned tunnel in model coordinates, mm; it is drilled from `start`.
struct BoneTunnel {
  Eigen::Vector3d start, end;
  std::optional<double> diameter_mm;
};

using guidance::BoneCheck;
using guidance::TunnelDistance;

/// Compares a tunnel with its bone. A tunnel's end opens where it lies outside the bone or at most 1 mm below
/// its surface, its start where it is at most 5 mm below; a start inside the bone is led back to the surface
/// along the axis. Where only the end opens, the tunnel is drilled from there; where neither does, or the
/// line passes bone beyond the CT, it has no entry (`NoEntry`). An opening's face, where the wall necessarily
/// leaves the bone: surface that continues from the opening, within 60 degrees of the face that most of the
/// opening lies on, as far as its distance from the axis grows with the depth (by 2 degrees or more).
BoneCheck check_tunnel(const BoneSurface& bone, const BoneTunnel& tunnel);

/// Between the walls of two tunnels in the same bone (axes, without a diameter), mm; negative: they meet.
double tunnel_distance_mm(const BoneCheck& a, const BoneCheck& b);

}  // namespace helicarm::registration
