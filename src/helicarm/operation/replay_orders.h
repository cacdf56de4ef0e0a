// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/operation/session_records.h"

namespace helicarm::operation {

/// Derives every order of a record, and what came of it, from the records before it.
class OrderReplay {
 public:
  /// A record's origin, and what those before it gave; `newest` is `measured`, or the verification after it.
  struct Context {
    std::string origin;
    const OperationPlan& plan;
    const std::optional<pipeline::Result>& measured;
    const std::optional<pipeline::Result>& newest;
  };
  /// Called with the record's origin and what differs.
  using Differ = std::function<void(const std::string& origin, const std::string& difference)>;

  explicit OrderReplay(Differ differ) : differ_(std::move(differ)) {}

  /// The records that concern orders. Throws BadInput.
  void follow(const Record& record, const Context& at);

  /// The tracker's samples for the verification that the next case holds, once.
  std::optional<PoseWindow> take_verify_look() { return std::exchange(verify_look_, std::nullopt); }
  /// Of the registered robot, or of the plan's drill.
  std::optional<TrackedTool> tool(const OperationPlan& plan) const;

  std::size_t orders = 0, confirmations = 0, outcomes = 0, replans = 0;

 private:
  struct Planned {
    robot::RobotOrder order;
    guidance::Bone bone = {};
    geometry::RigidTransform bone_from_target;
  };
  struct Leaving {
    std::string digest;  ///< of the order to the tunnel that is left
    Withdrawal from;
  };
  /// No order depends on them.
  template <record::OneOf<record::Session, record::Plan, record::Models, record::Exposure, record::Refused,
                          record::Touched, record::CaseBegun, record::Measured, record::Registered,
                          record::RegistrationConfirmed, record::Preview, record::Guide, record::Guided,
                          record::GuidanceEnded>
                Other>
  void take(const Other&, const Context&) {}
  void take(const record::Poses& poses, const Context& at);
  void take(const record::Robot& robot, const Context& at);
  void take(const record::Tour& tour, const Context& at);
  void take(const record::HandEye& hand_eye, const Context& at);
  void take(const record::Withdraw& withdraw, const Context& at);
  void take(const record::Order& order, const Context& at);
  void take(const record::Confirmed& confirmed, const Context& at);
  void take(const record::CarriedOut& carried_out, const Context& at);
  void take(const record::Halted& halted, const Context& at);
  void take(const record::Replanned& replanned, const Context& at);
  void take(const record::Navigated& navigated, const Context& at);
  void take(const record::Outcome& outcome, const Context& at);
  void take(const record::End& end, const Context& at);
  robot::RobotOrder derived(const std::string& name, const Context& at, std::optional<Planned>& planned);
  void compare(const Json& then, const Json& now, const Context& at, const char* what);

  Differ differ_;
  std::optional<tracker::HandEye> hand_eye_;
  std::optional<robot::Joints> joints_;  ///< of the order that follows
  std::vector<geometry::RigidTransform> whole_tour_;
  std::deque<geometry::RigidTransform> tour_;  ///< still to be ordered
  std::vector<PoseWindow> looks_;              ///< at the tool, at each pose of the tour
  std::optional<PoseWindow> plan_look_, verify_look_;
  std::optional<Leaving> leaving_;
  std::vector<PoseWindow> corrections_;     ///< since the last confirmation
  std::map<std::string, Planned> planned_;  ///< orders to a tunnel, by digest
  std::map<std::string, std::string> to_,
      other_;                              ///< by name: digest of the last order to a tunnel, of others
  std::map<std::string, int> replans_;     ///< by order
  std::optional<record::Confirmed> open_;  ///< a confirmation whose motion has not ended
  std::optional<Planned> reached_;         ///< by the last order that was carried out
  std::string unverified_;                 ///< tunnel that the tool has reached
};

/// Names of the first differing fields, for a message.
std::string differing_fields(const Json& then, const Json& now);

}  // namespace helicarm::operation
