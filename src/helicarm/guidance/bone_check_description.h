// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include "helicarm/core/output.h"
#include "helicarm/guidance/bone_check.h"

namespace helicarm::guidance {

/// "bone_check" of result.json and registration.json (core/output.h).
template <class Output>
void describe_bone_check(Output& output, const BoneCheck& check) {
  output.value("diameter_mm", check.diameter_mm,
               "as planned; `null`: only the axis was compared, and `note` says so");
  output.value(
      "bridge_mm", check.bridge_mm,
      "least distance of the tunnel's wall from the bone's surface, negative where the wall is outside");
  output.value("bridge_sigma_mm", check.sigma_mm,
               "standard deviation of `bridge_mm` by the surface's own error");
  output.value("drilled_sigma_mm", check.drilled_sigma_mm,
               "likewise with the error of the registration across that surface, which decides");
  output.value("required_bridge_mm", check.required_mm, "as planned; `null` without a diameter");
  output.value("at_mm", check.at_mm, "depth of that place along the axis behind the entry");
  output.value("length_in_bone_mm", check.length_in_bone_mm, "of the axis");
  output.value(
      "entry_mm", check.entry,
      "where the axis enters the bone, in the model's coordinates; `null`: the line does not meet it, opens "
      "nowhere, or enters or leaves it where the volume ends, as `note` says");
  output.value("exit_mm", check.exit, "where it leaves the bone; `null` for a blind tunnel too");
  output.value("entry_angle_deg", check.entry_angle_deg,
               "between axis and surface there; 90 is perpendicular");
  output.value("exit_angle_deg", check.exit_angle_deg, "likewise");
  output.value("end_mm", check.end_mm, "bone ahead of a blind tunnel's end");
  output.value("end_sigma_mm", check.end_sigma_mm,
               "standard deviation of `end_mm` by the surface's own error");
  output.value("drilled_end_sigma_mm", check.drilled_end_sigma_mm,
               "likewise with the error of the registration across that surface, which decides");
  output.object_of(
      "least_sure", check.least_sure(),
      "the place of the wall, or of a blind end, where a breach is least excluded; `null` without "
      "a surface nearby",
      [](auto& row, const WallPlace& place) {
        row.value("distance_mm", place.distance_mm, "from the bone's surface");
        row.value("drilled_sigma_mm", place.drilled_sigma_mm, "its standard deviation");
        row.value("at_mm", place.at_mm, "depth along the axis behind the entry");
      });
  output.value(
      "breach", [&] { return check.is_breach(); }, "whether it is refused (`tunnel_breach`)");
  output.value(
      "thin", [&] { return check.is_thin(); }, "whether it is warned of (`bridge_thin`)");
  output.list("to_tunnels", check.to_tunnels, "each other tunnel with a diameter in the same model",
              [](auto& row, const TunnelDistance& other) {
                row.value("name", other.tunnel, "");
                row.value("distance_mm", other.distance_mm, "between the walls; negative: they meet");
              });
  output.value(
      "note",
      [&] {
        constexpr auto axis_alone =
            "the tunnel has no diameter_mm: its wall was not compared with the bone's surface";
        if (!check.entry) return std::optional(fmt::format("the line {}", words(check.no_entry)));
        return check.diameter_mm ? std::nullopt : std::optional<std::string>(axis_alone);
      },
      "for people");
}

}  // namespace helicarm::guidance
