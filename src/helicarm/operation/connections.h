// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "helicarm/devices/receiver/image_registry.h"
#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/tracker_source.h"
#include "helicarm/operation/plan.h"

namespace helicarm::operation {

/// An image and its arrival time (monotonic seconds).
struct DatedArrival {
  receiver::Arrival arrival;
  double time_s;
};

/// State of the C-arm's connection. A C-arm connects only to send an image.
struct CArmStatus {
  std::optional<double> last_image_s;  ///< monotonic seconds
  std::optional<Failure> refused;      ///< an image refused since then
  bool broke_off = false;              ///< a connection since then was lost or its request rejected
};

/// Greatest age of the data that guide a robot, s. Only tests on a busy machine use other limits than those
/// of the plan's tracker (`freshness_limits`).
struct FreshnessLimits {
  double pose_s = 0.1;       ///< of tool and bones; a repeated pose has the age of its first arrival
  double state_s = 0.1;      ///< of the robot
  double heartbeat_s = 0.1;  ///< ends this long after the program's last poll
  double frozen_s = 0.1;     ///< for which a repeated pose is accepted
};
FreshnessLimits freshness_limits(const TrackerPlan& tracker);

/// The devices of a plan: C-arm, tracker and, without a hand-held drill, robot. Tracker and robot are
/// connected at the start and reconnected after a loss.
class Connections {
 public:
  /// Throws BadInput for invalid addresses.
  Connections(const OperationPlan& plan, std::unique_ptr<receiver::Inbox> inbox)
      : Connections(plan, std::move(inbox), freshness_limits(plan.tracker)) {}
  Connections(const OperationPlan& plan, std::unique_ptr<receiver::Inbox> inbox,
              const FreshnessLimits& limits);

  /// Starts receiving images. Refuses as `open_images`.
  Expected<void> listen(const receiver::ImageSourceOptions& options);
  /// Of the source of images; 0: it has none.
  std::uint16_t receiver_port() const { return images_->port(); }

  /// The oldest image not yet taken; empty if none arrives within this time.
  std::optional<DatedArrival> next_image(double patience_s);

  const tracker::PoseBoard& board() const { return board_; }
  /// Throws BadInput (usage) for a plan with a hand-held drill.
  robot::RobotLink& robot();
  /// Null for a plan with a hand-held drill.
  robot::RobotLink* robot_if_any() { return robot_.get(); }
  /// State before `listen`: no image received.
  CArmStatus c_arm() const;

 private:
  std::uint64_t broken() const { return images_ ? images_->broken() : 0; }

  std::unique_ptr<receiver::Inbox> inbox_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::deque<DatedArrival> arrivals_;
  CArmStatus c_arm_;
  std::uint64_t broken_before_ = 0;  ///< connections lost before the last image
  tracker::PoseBoard board_;
  std::unique_ptr<robot::RobotLink> robot_;  ///< null for a hand-held drill
  std::unique_ptr<tracker::TrackerSource> tracker_;
  std::unique_ptr<receiver::ImageSource> images_;
};

}  // namespace helicarm::operation
