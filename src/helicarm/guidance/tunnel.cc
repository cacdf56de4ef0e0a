// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/tunnel.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace helicarm::guidance {

std::optional<double> Tunnel::axis_sigma_deg() const {
  if (!axis_covariance) return std::nullopt;
  return std::sqrt(axis_covariance->trace()) * 180 / std::numbers::pi;
}

Expected<Tunnel> plan_tunnel(const std::string& name, const PointInFrames& start, const PointInFrames& end,
                             const Eigen::MatrixXd& calibration_covariance, const TrackerNoise& noise) {
  const bool ordered = start.in_tool && end.in_tool;
  const Eigen::Vector3d along =
      ordered ? end.in_tool->point() - start.in_tool->point() : end.in_calibrator - start.in_calibrator;
  const double length = along.norm();
  if (!(length >= shortest_tunnel_mm && length <= longest_tunnel_mm))
    return fail(Reason::bad_tunnel,
                fmt::format("tunnel \"{}\" is {:.3g} mm long, must be {} to {} mm", name, length,
                            shortest_tunnel_mm, longest_tunnel_mm),
                {{"length_mm", length}, {"limit_mm", longest_tunnel_mm}});
  Tunnel tunnel{name, {}, {}, {}, length};
  tunnel.start_in_bones = start.in_bones;
  tunnel.end_in_bones = end.in_bones;
  if (ordered) {
    tunnel.start_in_tool = start.in_tool->point();
    tunnel.end_in_tool = end.in_tool->point();
    tunnel.axis_in_tool = along / length;
    const Eigen::Matrix3d covariance =
        covariance_between(start.in_tool->propagated, end.in_tool->propagated, calibration_covariance, noise);
    const Eigen::Vector3d axis = along / length;
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - axis * axis.transpose()) / length;
    tunnel.axis_covariance = across * covariance * across;
    tunnel.length_sigma_mm = std::sqrt(axis.dot(covariance * axis));
  }
  return tunnel;
}

}  // namespace helicarm::guidance
