// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"
#include "helicarm/devices/tracker/sequence_file.h"

namespace helicarm::tracker {

/// The poses of a message as received, at the device's time or else at the arrival's; empty if it has none.
/// Characters not allowed in a name become "_".
SequenceFrame frame_of(const IgtlMessage& message, double arrival_s);

/// A frame as one TDATA, or as a TRANSFORM for each tool; hidden tools are absent.
std::vector<IgtlMessage> messages_of(const SequenceFrame& frame, bool as_tracking, double time_s);

/// Stores frames up to a number of poses: 4 million use about 1 GiB.
class SequenceRecorder {
 public:
  explicit SequenceRecorder(std::size_t most_poses = 4'000'000) : most_poses_(most_poses) {}

  /// Whether there was room; a frame without poses needs none.
  bool take(SequenceFrame frame);
  const std::vector<SequenceFrame>& frames() const { return frames_; }
  std::size_t most_poses() const { return most_poses_; }

 private:
  const std::size_t most_poses_;
  std::size_t poses_ = 0;
  std::vector<SequenceFrame> frames_;
};

struct GatedPoses {
  std::vector<geometry::RigidTransform> tracker_from_tool;
  Counters rejected;  ///< by code of PoseFault
};

/// One tool's poses as a live PoseGate would have accepted them.
GatedPoses gated_poses(std::span<const SequenceFrame> frames, const std::string& tool);

/// Sends the frames repeatedly with their recorded timing, stamped with the present time, until stopped;
/// stops immediately. Frames must be ordered by time.
void replay(std::span<const SequenceFrame> frames, bool as_tracking,
            const std::function<void(const IgtlMessage&)>& send, const std::stop_token& stop);

}  // namespace helicarm::tracker
