// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace helicarm::guidance {

/// Distance to another tunnel in the same bone.
struct TunnelDistance {
  std::string tunnel;
  double distance_mm = 0;  ///< between the walls; negative: they meet
};

/// A place of a planned tunnel's wall, or of a blind tunnel's end, and the bone between it and the surface.
struct WallPlace {
  double distance_mm = 0;                             ///< negative: outside the bone
  double sigma_mm = 0;                                ///< of the distance, by the surface's own error
  double drilled_sigma_mm = 0;                        ///< likewise with the error of the registration
  double at_mm = 0;                                   ///< depth along the axis from the entry
  Eigen::Vector3d on_axis = Eigen::Vector3d::Zero();  ///< at that depth
  /// How the distance grows as the surface moves against the tunnel: its normal, of a surface ahead of an end
  /// divided by its cosine to the axis.
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();

  /// Positive: that the place leaves the bone is excluded at 95 % (one-sided).
  double margin_mm() const;
};

/// Why a line has no entry into the bone that can be compared.
enum class NoEntry { beside_bone, beyond_ct, opens_nowhere };

/// The same as the end of a sentence about the line.
std::string_view words(NoEntry reason);

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
  std::optional<Eigen::Vector3d> entry = {};  ///< on the bone's surface; nothing: see `no_entry`
  NoEntry no_entry = NoEntry::beside_bone;
  std::optional<Eigen::Vector3d> exit = {};  ///< likewise; nothing: a blind tunnel
  std::optional<double> entry_angle_deg = {},
                        exit_angle_deg = {};        ///< between axis and surface; 90: perpendicular
  std::optional<double> end_mm = {};                ///< bone ahead of a blind tunnel's end
  std::optional<double> end_sigma_mm = {};          ///< likewise, by the surface's own error
  std::optional<double> drilled_end_sigma_mm = {};  ///< likewise with the error of the registration
  Eigen::Vector3d end = Eigen::Vector3d::Zero();    ///< of the axis: its exit, or the blind end
  std::vector<TunnelDistance> to_tunnels = {};
  std::vector<WallPlace> wall = {}, ahead = {};  ///< nearest places around the axis, and ahead of a blind end

  /// Of `wall` and `ahead`, where a breach is least excluded; nothing without a surface nearby.
  std::optional<WallPlace> least_sure() const;
  /// The wall, or the end of a blind tunnel, leaves the bone somewhere: not excluded at 95 % (one-sided).
  bool is_breach() const;
  /// The bridge, or the bone ahead of the end, is below `required_mm`.
  bool is_thin() const;
};

}  // namespace helicarm::guidance
