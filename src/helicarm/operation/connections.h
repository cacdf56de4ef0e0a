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

/// A picture and when it came (monotonic seconds).
struct DatedArrival {
  Arrival arrival;
  double time_s;
};

/// The three devices of a plan. Tracker and robot are connected to from the start, and again whenever they
/// were away.
class Connections {
 public:
  /// Throws BadInput for a plan whose addresses are none.
  Connections(const OperationPlan& plan, std::unique_ptr<Inbox> inbox);

  /// Takes pictures from now on. Refuses as DicomReceiver.
  Expected<void> listen(const ReceiverOptions& options);
  std::uint16_t receiver_port() const { return receiver_->port(); }

  /// The oldest picture that nobody took yet; nothing if none comes within this time.
  std::optional<DatedArrival> next_picture(double patience_s);

  const PoseBoard& board() const { return board_; }
  RobotLink& robot() { return robot_; }

 private:
  std::unique_ptr<Inbox> inbox_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<DatedArrival> arrivals_;
  PoseBoard board_;
  RobotLink robot_;
  std::unique_ptr<IgtlClient> tracker_;
  std::unique_ptr<DicomReceiver> receiver_;
};

}  // namespace helicarm
