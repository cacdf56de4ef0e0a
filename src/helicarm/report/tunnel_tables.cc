// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/pipeline/outcome.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/tables.h"

namespace helicarm::report {
namespace {

/// A tunnel of picks or of a model's plan.
struct TunnelRow {
  const guidance::Tunnel* tunnel;
  std::string model;  ///< empty: of picks
  std::optional<double> start_error_mm, end_error_mm;
};

std::vector<TunnelRow> tunnel_rows(const pipeline::Result& result) {
  std::vector<TunnelRow> rows;
  for (const guidance::Tunnel& tunnel : result.tunnels)
    rows.push_back({&tunnel,
                    {},
                    pipeline::tunnel_end_error_in_tool(result, tunnel.name, true),
                    pipeline::tunnel_end_error_in_tool(result, tunnel.name, false)});
  const auto error = [&](std::size_t end) {
    const auto& in_tool = result.model_points[end].place.in_tool;
    return in_tool ? std::optional(localization::length_at_95(in_tool->covariance)) : std::nullopt;
  };
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    rows.push_back({&planned.tunnel, planned.model, error(planned.ends.start), error(planned.ends.end)});
  return rows;
}

}  // namespace

Table tunnels_table(const pipeline::Result& result) {
  using Row = TunnelRow;
  constexpr const char* bound = "Length that 95 % of the errors of that end do not exceed, mm";
  return table_of<Row>(
      "Tunnels in the tool's frame",
      {{words("Tunnel", "Name of the tunnel"), [](const Row& r) { return Cell{r.tunnel->name}; }},
       {words("Model", "Registered model whose plan names the tunnel; empty: its ends are picked"),
        [](const Row& r) { return Cell{r.model}; }},
       {words("Start x, y, z, mm", "Start of the tunnel in the tool's frame, mm"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->start_in_tool, 2)}; }},
       {number("±95 %, mm", bound), [](const Row& r) { return Cell{fixed(r.start_error_mm, 3)}; }},
       {words("End x, y, z, mm", "End of the tunnel in the tool's frame, mm"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->end_in_tool, 2)}; }},
       {number("±95 %, mm", bound), [](const Row& r) { return Cell{fixed(r.end_error_mm, 3)}; }},
       {words("Axis", "Unit vector from start to end in the tool's frame"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->axis_in_tool, 4)}; }},
       {number("Axis σ, °", "Standard deviation of the axis' direction, degrees"),
        [](const Row& r) { return Cell{fixed(r.tunnel->axis_sigma_deg(), 3)}; }},
       {number("Length, mm", "Distance from start to end, mm"),
        [](const Row& r) { return Cell{fixed(r.tunnel->length_mm, 2)}; }}},
      tunnel_rows(result));
}

Table bone_table(const std::vector<TunnelInBoneRow>& tunnels) {
  using Row = TunnelInBoneRow;
  const auto figure = [](std::optional<double> guidance::BoneCheck::*member, int digits) {
    return [=](const Row& r) { return Cell{fixed(r.check.*member, digits)}; };
  };
  using guidance::BoneCheck;
  return table_of<Row>(
      "Tunnels in the bone",
      {{words("Tunnel", "Name of the tunnel"), [](const Row& r) { return Cell{r.tunnel}; }},
       {words("Model", "Registered model whose plan names the tunnel"),
        [](const Row& r) { return Cell{r.model}; }},
       {number("Diameter, mm", "Diameter of the tunnel, mm"), figure(&BoneCheck::diameter_mm, 1)},
       {number("Bridge, mm",
               "Least distance of the tunnel's wall from the bone's surface, mm; negative: outside the bone"),
        [](const Row& r) {
          return Cell{fixed(r.check.bridge_mm, 2), r.check.is_breach() || r.check.is_thin()};
        }},
       {number("σ, mm", "Standard deviation of the bridge as drilled, with the registration, mm"),
        figure(&BoneCheck::drilled_sigma_mm, 2)},
       {number("At, mm", "Depth of that place behind the entry, mm"), figure(&BoneCheck::at_mm, 1)},
       {number("In bone, mm", "Length of the axis in the bone, mm"),
        [](const Row& r) { return Cell{fixed(r.check.length_in_bone_mm, 1)}; }},
       {number("Entry, °", "Angle between axis and bone surface at the entry, degrees"),
        figure(&BoneCheck::entry_angle_deg, 0)},
       {number("Exit, °", "Angle between axis and bone surface at the exit, degrees"),
        figure(&BoneCheck::exit_angle_deg, 0)},
       {number("Ahead, mm", "Bone ahead of a blind tunnel's end, mm"), figure(&BoneCheck::end_mm, 2)},
       {number("Ahead σ, mm", "Its standard deviation as drilled, with the registration, mm"),
        figure(&BoneCheck::drilled_end_sigma_mm, 2)}},
      tunnels);
}

Table bone_table(const pipeline::Result& result) {
  std::vector<TunnelInBoneRow> rows;
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    if (planned.bone_check) rows.push_back({planned.tunnel.name, planned.model, *planned.bone_check});
  return bone_table(rows);
}

std::vector<ToolAtEnd> tools_at_ends(const std::vector<guidance::Verification>& lines) {
  std::vector<ToolAtEnd> tools;
  for (const guidance::Verification& line : lines) {
    for (const auto& [end, error] : {std::pair{"start", &line.start}, {"end", &line.end}})
      if (*error) tools.push_back({line.name, end, {}, {}, *error});
    if (line.depth) tools.push_back({line.name, "tip", {}, {}, {}, line.depth});
  }
  return tools;
}

Table verification_table(const std::vector<ToolAtEnd>& tools) {
  const auto in_images = [](double guidance::LineError::*member) {
    return [member](const ToolAtEnd& t) {
      return t.in_images ? Cell{fixed((*t.in_images).*member, 2)} : Cell{};
    };
  };
  using guidance::LineError;
  return table_of<ToolAtEnd>(
      "Verification",
      {{words("Tunnel", "Name of the tunnel"), [](const ToolAtEnd& t) { return Cell{t.tunnel}; }},
       {words("End", "Start or end of the tunnel; tip: of a drill held by hand"),
        [](const ToolAtEnd& t) { return Cell{t.end}; }},
       {number("Error, mm", "Distance of the end from the tool's axis by tracker and X-ray images, mm"),
        [](const ToolAtEnd& t) { return Cell{fixed(t.distance_mm, 2)}; }},
       {number("Predicted rms, mm", "Root mean square of that distance by the covariances, mm"),
        [](const ToolAtEnd& t) { return Cell{fixed(t.predicted_mm, 2)}; }},
       {number("Eq. 17, px", "Distance in the X-ray images, all views combined (Eq. 17), px"),
        in_images(&LineError::combined_px)},
       {number("Eq. 17, mm", "The same, converted to mm at the depth of the end"),
        in_images(&LineError::combined_mm)},
       {number("In space, mm", "Distance of the end from the tool's axis by the X-ray images alone, mm"),
        in_images(&LineError::distance_mm)},
       {number(
            "Beyond end, mm",
            "Of the drill's tip along the tunnel, negative before the planned end, with its 95 % error, mm"),
        [](const ToolAtEnd& t) {
          if (!t.depth) return Cell{};
          return Cell{fmt::format("{:+.2f} ± {:.2f}", t.depth->beyond_end_mm, t.depth->error_95_mm()),
                      t.depth->why_off(t.tunnel).has_value()};
        }}},
      tools);
}

}  // namespace helicarm::report
