// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm {

/// An image and when it came (monotonic seconds).
struct DatedArrival {
  Arrival arrival;
  double time_s;
};

/// The C-arm as its receiver knows it: it calls when it has an image, and is not heard of in between.
struct CArmStatus {
  std::optional<double> last_image_s;  ///< monotonic seconds
  std::optional<Failure> refused;      ///< an image since then
  bool broke_off = false;              ///< a connection since then was lost, or its request turned down
};

/// How old what guides a robot may be, s. Only tests on a busy machine use other limits than these.
struct FreshnessLimits {
  double pose_s = 0.1;       ///< of tool and bones; a repeated pose is as old as when it first came
  double state_s = 0.1;      ///< of the robot
  double heartbeat_s = 0.1;  ///< it ends so long after this program last looked
};

/// The three devices of a plan. Tracker and robot are connected to from the start, and again whenever they
/// were away.
class Connections {
 public:
  /// Throws BadInput for a plan whose addresses are none.
  Connections(const OperationPlan& plan, std::unique_ptr<Inbox> inbox, const FreshnessLimits& limits = {});

  /// Takes images from now on. Refuses as DicomReceiver.
  Expected<void> listen(const ReceiverOptions& options);
  std::uint16_t receiver_port() const { return receiver_->port(); }

  /// The oldest image that nobody took yet; nothing if none comes within this time.
  std::optional<DatedArrival> next_image(double patience_s);

  const PoseBoard& board() const { return board_; }
  RobotLink& robot() { return robot_; }
  /// Before `listen`: nothing came yet.
  CArmStatus c_arm() const;

 private:
  std::uint64_t broken() const;

  std::unique_ptr<Inbox> inbox_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::deque<DatedArrival> arrivals_;
  CArmStatus c_arm_;
  std::uint64_t broken_before_ = 0;  ///< connections, when the last image came
  PoseBoard board_;
  RobotLink robot_;
  std::unique_ptr<IgtlClient> tracker_;
  std::unique_ptr<DicomReceiver> receiver_;
};

}  // namespace helicarm
