// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/operation/freehand.h"
#include "helicarm/operation/plan_watch.h"

namespace helicarm::operation {

/// The last plan to a tunnel.
struct PlannedOrder {
  std::string order;  ///< its text, which the confirmation must match
  geometry::RigidTransform bone_from_target;
  PlanWatch watch;
  std::optional<Failure> stale = {};  ///< set when first found stale
};

/// What may move or guide the tool at present: the registration of the plan's models, the robot's orders and
/// the guidance of a drill. Knows neither files nor devices, so that random sequences of events can test it.
class GuidanceGate {
 public:
  /// A registration of the present images was made. `refusal`: its own, or that of a model.
  void registered(std::optional<Failure> refusal);
  /// A person has compared the outlines with the images. Refuses (usage) without a registration, and as the
  /// registration was refused.
  Expected<void> confirm();
  Expected<void> confirmable() const;
  bool is_confirmed() const { return state_ == Registration::confirmed; }
  /// Images, picks or the measurement are others now: ends the orders and the guidance to models' tunnels.
  void forget_registration(std::span<const OperationTunnel> tunnels);
  /// Images or measurement are others now: ends all orders and guidance.
  void forget_plans();
  /// Refuses a model's tunnel without a confirmed registration (registration_not_confirmed,
  /// registration_stale).
  Expected<void> check_registered(const OperationTunnel& tunnel) const;

  void plan(const std::string& tunnel, PlannedOrder planned);
  /// Refuses (usage) an order to a tunnel that was not planned.
  Expected<PlannedOrder> planned(const std::string& tunnel) const;
  /// Whether this order is the last plan to its tunnel.
  bool is_planned(const robot::RobotOrder& order) const;
  bool is_stale(const std::string& tunnel) const;
  /// A plan once found stale stays stale.
  void found_stale(const std::string& tunnel, const Failure& why);
  /// Refuses as `check_registered`, `planned` and `PlanWatch::holds`; plan_stale for an order that is not the
  /// last plan to its tunnel.
  Expected<void> may_move(const robot::RobotOrder& order, const OperationTunnel& tunnel,
                          const tracker::PoseBoard& board, const robot::ToolTrack& track, double now_s);

  void guide(FreehandGuide guide);
  void end_guidance();
  const std::optional<FreehandGuide>& guide() const { return guide_; }
  /// At the window's end; once shown as plan_stale it stays so until guidance begins again. Needs a guide.
  Guidance guidance(const PoseWindow& recent) const;
  bool is_new(const Guidance& guidance) const;
  /// The last decision shown is plan_stale.
  bool is_guidance_stale() const;
  void shown(const Guidance& guidance) { shown_ = guidance; }

 private:
  enum class Registration { none, refused, registered, confirmed };

  Registration state_ = Registration::none;
  bool was_registered_ = false;  ///< earlier images were
  std::optional<Failure> refusal_;
  std::map<std::string, PlannedOrder> planned_;  ///< by tunnel
  std::optional<FreehandGuide> guide_;
  std::optional<Guidance> shown_;  ///< the last new decision
};

}  // namespace helicarm::operation
