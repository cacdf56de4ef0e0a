// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/plan_approach.h"

#include <numbers>
#include <optional>

#include "helicarm/geometry/rotation.h"

namespace helicarm::robot {
namespace {

/// Shortest rotation of the z axis of `from` onto `axis`.
Eigen::Matrix3d aligned(const Eigen::Matrix3d& from, const Eigen::Vector3d& axis) {
  return geometry::rotation_between(from.col(2), axis) * from;
}

}  // namespace

Expected<RobotOrder> plan_approach(const std::string& name, const RobotModel& model, const RobotTool& tool,
                                   const Joints& present, const TunnelAxis& axis,
                                   const ApproachOptions& options) {
  const Eigen::Vector3d along = axis.end_in_base - axis.start_in_base;
  if (!(along.norm() >= 1)) return fail(Reason::bad_tunnel, "tunnel \"" + name + "\" has no direction");
  if (!(options.stand_off_mm > options.gap_mm))
    return fail(Reason::bad_value, "approach: stand_off_mm must be greater than gap_mm",
                {{"stand_off_mm", options.stand_off_mm}, {"gap_mm", options.gap_mm}});
  const Eigen::Vector3d direction = along.normalized();
  const Eigen::Matrix3d nearest =
      aligned((base_from_flange(model, present) * tool.flange_from_tcp).rotation, direction);
  RobotOrder order{name, model.name, tool, present, {}, options.keep_outs, options.corrections};
  std::optional<RobotOrder> best;
  std::optional<Failure> refusal;
  double least_motion = 0;
  constexpr int turns = 36;
  for (int i = 0; i < turns; ++i) {
    const int step = (i % 2 ? 1 : -1) * ((i + 1) / 2);
    const double turn = step * 2 * std::numbers::pi / turns;
    const Eigen::Matrix3d rotation = nearest * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ());
    order.waypoints = {{{rotation, axis.start_in_base - options.stand_off_mm * direction},
                        options.travel_mm_s,
                        options.acceleration_mm_s2},
                       {{rotation, axis.start_in_base - options.gap_mm * direction},
                        options.approach_mm_s,
                        options.acceleration_mm_s2}};
    const auto end = check_path(order, options.limits);
    if (!end) {
      if (!refusal) refusal = end.error();
      continue;
    }
    const double motion = (*end - present).cwiseAbs().maxCoeff();
    if (!best || motion < least_motion) {
      best = order;
      least_motion = motion;
    }
  }
  if (!best) return tl::unexpected<Failure>(*refusal);
  return *best;
}

}  // namespace helicarm::robot
