// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <thread>
#include <vector>

#include "helicarm/devices/tracker/sequence_file.h"
#include "helicarm/devices/tracker/tracker_source.h"

namespace helicarm::tracker {

/// A sequence file as a tracker: its frames repeatedly, with their recorded timing and present time stamps.
class PlayedSequence final : public TrackerSource {
 public:
  /// Refuses as `read_sequence`, and no_pose for a file without frames.
  static Expected<std::unique_ptr<PlayedSequence>> open(const std::filesystem::path& file,
                                                        TrackerListener listener);
  ~PlayedSequence() override { stop(); }

  /// Always connected; "messages" is the only counter.
  TrackerLinkStatus status() const override;
  void stop() override;

 private:
  PlayedSequence(std::vector<SequenceFrame> frames, TrackerListener listener);

  std::vector<SequenceFrame> frames_;
  TrackerListener listener_;
  std::atomic<std::uint64_t> messages_ = 0;
  std::jthread thread_;
};

}  // namespace helicarm::tracker
