// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace helicarm::measures {

/// What is measured in one image.
enum class Kind {
  distance,
  angle,       ///< at a vertex
  line_angle,  ///< between two lines, 0 to 90 degrees
  circle,      ///< least-squares circle through three or more points
  /// Depth and height of points in the femur on a lateral view, per cent. Depth: along Blumensaat's line, 0
  /// at the condyle's posterior border, 100 at its anterior one. Height: perpendicular to it, 0 on the line,
  /// 100 at the condyle's inferior border. M. Bernard, P. Hertel, H. Hornung, T. Cierpinski: Femoral
  /// insertion of the ACL: radiographic quadrant method. Am J Knee Surg 10(1), 14-21, 1997.
  femoral_quadrants,
  /// Position of points along the sagittal diameter of the tibial plateau on a lateral view, per cent from
  /// its anterior margin. H.-U. Staeubli, W. Rauschning: Tibial attachment area of the anterior cruciate
  /// ligament in the extended knee position. Knee Surg Sports Traumatol Arthrosc 2(3), 138-146, 1994. With a
  /// plateau line the diameter is taken parallel to it: A. A. Amis, R. P. Jakob: Anterior cruciate ligament
  /// graft positioning, tensioning and twisting. Knee Surg Sports Traumatol Arthrosc 6 Suppl 1, S2-S12, 1998.
  tibia_ap,
  /// Position along the width of the tibial plateau on an AP view, per cent from its medial margin.
  tibia_ml,
};

/// A click that a kind needs. Optional ones are given all or none.
struct Role {
  std::string_view word;
  std::string_view place;  ///< where to click
  bool is_optional = false;
};

/// What clicks of other names are.
enum class Further { refused, rim, points };

struct KindInfo {
  Kind kind;
  std::string_view word;   ///< in files
  std::string_view label;  ///< for a user
  std::string_view brief;  ///< on a button
  std::span<const Role> roles;
  Further further = Further::refused;
  std::span<const std::string_view> components = {};  ///< of a point's position, per cent
  std::span<const std::string_view> spans = {};       ///< the lengths of 100 % of them
};

std::span<const KindInfo> kinds();
const KindInfo& info_of(Kind kind);
std::optional<Kind> kind_named(std::string_view word);

}  // namespace helicarm::measures
