// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/json.h"

namespace helicarm::registration {

class BoneSurface;

/// A planned tunnel in model coordinates, mm; it is drilled from `start`.
struct BoneTunnel {
  Eigen::Vector3d start, end;
  std::optional<double> diameter_mm;
};

/// Distance to another tunnel in the same bone.
struct TunnelDistance {
  std::string tunnel;
  double distance_mm = 0;  ///< between the walls; negative: they meet
};

/// A planned tunnel against its bone. Points in model coordinates; depths along the axis from the entry, mm.
struct BoneCheck {
  std::optional<double> diameter_mm = {};  ///< nothing: only the axis was compared
  std::optional<double> required_mm = {};  ///< bridge below which is warned
  /// Least distance of the wall from the bone's surface beside the tunnel, negative where the wall leaves the
  /// bone. The faces through which the tunnel opens do not count. Nothing: no surface within 60 mm.
  std::optional<double> bridge_mm = {};
  std::optional<double> sigma_mm = {};  ///< of the bridge, by the surface's own error
  /// Of the bridge of the tunnel as it will be drilled: with the error of the registration.
  std::optional<double> drilled_sigma_mm = {};
  std::optional<double> at_mm = {};                    ///< depth of the bridge
  Eigen::Vector3d thinnest = Eigen::Vector3d::Zero();  ///< on the axis at that depth
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();   ///< normal of the surface nearest to it
  double length_in_bone_mm = 0;
  std::optional<Eigen::Vector3d> entry =
      {};  ///< on the bone's surface; nothing: the line does not meet the bone
  std::optional<Eigen::Vector3d> exit = {};  ///< likewise; nothing: a blind tunnel
  std::optional<double> entry_angle_deg = {},
                        exit_angle_deg = {};      ///< between axis and surface; 90: perpendicular
  std::optional<double> end_mm = {};              ///< bone ahead of a blind tunnel's end
  std::optional<double> end_sigma_mm = {};        ///< likewise
  Eigen::Vector3d end = Eigen::Vector3d::Zero();  ///< of the axis: its exit, or the blind end
  std::vector<TunnelDistance> to_tunnels = {};

  /// The wall, or the end of a blind tunnel, leaves the bone: not excluded at 95 % (one-sided).
  bool is_breach() const;
  /// The bridge, or the bone ahead of the end, is below `required_mm`.
  bool is_thin() const;
};

/// Compares a tunnel with its bone. A tunnel's end opens where it lies outside the bone or at most 1 mm below
/// its surface, its start where it is at most 5 mm below; a start inside the bone is led back to the surface
/// along the axis. Where only the end opens, the tunnel is drilled from there. An opening's face, where the
/// wall necessarily leaves the bone: surface that continues from the opening, within 60 degrees of the
/// surface there, as far as its distance from the axis grows with the depth (by 2 degrees or more).
BoneCheck check_tunnel(const BoneSurface& bone, const BoneTunnel& tunnel);

/// Between the walls of two tunnels in the same bone (axes, without a diameter), mm; negative: they meet.
double tunnel_distance_mm(const BoneCheck& a, const BoneCheck& b);

}  // namespace helicarm::registration
