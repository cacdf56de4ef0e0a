// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/operation/tool_line.h"

/// What an operation derives from recorded values, so that `replay` derives the same.
namespace helicarm::operation {

/// Largest number of plans made again for the registration, and for each tunnel: an operation whose orders
/// are stopped more often needs another machine or network. Measured on two saturated cores: up to 20 to one
/// tunnel.
inline constexpr int most_replans = 50;

/// Position of a tool relative to its tunnel after the robot's approach.
struct TunnelOutcome {
  std::string tunnel;
  std::vector<robot::Miss> loop;  ///< measurements of the closed loop; the last one is within the tolerance
  EndMiss start;                  ///< across the tool's axis, from tracker and X-ray images
  EndMiss end;
  std::optional<guidance::Verification> verification;  ///< Eq. 17 in the X-ray images
  int replans = 0;                                     ///< plans made again until the tool was there

  /// Of a drill in a person's hand.
  std::optional<guidance::TipDepth> depth() const {
    return verification ? verification->depth : std::nullopt;
  }
};

/// The order to a tunnel from these joints. Fails as `tunnel_in_bone` and `plan_approach`.
Expected<robot::RobotOrder> tunnel_order(const OperationPlan& plan, const OperationTunnel& tunnel,
                                         const pipeline::Result& result, const tracker::HandEye& hand_eye,
                                         const guidance::Poses& now, const robot::Joints& joints);

/// The target of an order to a tunnel, in the frame of the bone's marker at planning.
geometry::RigidTransform target_in_bone(const robot::RobotOrder& order, const guidance::Bone& bone,
                                        const guidance::Poses& now, const tracker::HandEye& hand_eye);

/// From a tunnel's order, where the tool is now, back along the tool's axis to the stand-off distance (unless
/// it is there) and to the pose before the order.
struct Withdrawal {
  geometry::RigidTransform base_from_tcp;  ///< now
  geometry::RigidTransform base_from_rest;
};
robot::RobotOrder withdraw_order(const robot::RobotOrder& order, const Withdrawal& from,
                                 const robot::Joints& joints, const robot::RobotLimits& limits);

/// Adds to each verified tunnel of a hand-held drill how deep its tip is, from the tracked drill, and warns
/// as `TipDepth::why_off`. A robot's tool stops at its gap from the entry and drills nothing: nothing is
/// added.
void add_depths(const OperationPlan& plan, const TrackedTool& tool, pipeline::Result& result);
/// Adds the warning of a verified tunnel's depth, if any.
void warn_of_depth(const guidance::Verification& verified, pipeline::Result& result);

/// From a measurement with the tool's line; without the closed loop. Refuses (not_seen) an end that is not
/// located in the tool's frame.
Expected<TunnelOutcome> outcome_of(const OperationTunnel& tunnel, const pipeline::Result& result,
                                   const TrackedTool& tool);

}  // namespace helicarm::operation
