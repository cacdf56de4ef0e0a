// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/tunnel.h"

#include <fmt/format.h>

namespace helicarm {

Expected<Tunnel> plan_tunnel(const std::string& name, const GuidedPoint& start, const GuidedPoint& end) {
  const bool ordered = start.in_tool && end.in_tool;
  const Eigen::Vector3d along =
      ordered ? *end.in_tool - *start.in_tool : end.in_calibrator - start.in_calibrator;
  const double length = along.norm();
  if (!(length >= shortest_tunnel_mm && length <= longest_tunnel_mm))
    return fail(Reason::bad_tunnel,
                fmt::format("tunnel \"{}\" is {:.3g} mm long, must be {} to {} mm", name, length,
                            shortest_tunnel_mm, longest_tunnel_mm),
                {{"length_mm", length}, {"limit_mm", longest_tunnel_mm}});
  Tunnel tunnel{name, {}, {}, {}, length};
  if (ordered) {
    tunnel.start_in_tool = start.in_tool;
    tunnel.end_in_tool = end.in_tool;
    tunnel.axis_in_tool = along / length;
  }
  return tunnel;
}

}  // namespace helicarm
