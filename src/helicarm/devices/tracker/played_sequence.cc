// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/played_sequence.h"

#include "helicarm/core/real_time.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/sequence_stream.h"

namespace helicarm::tracker {

PlayedSequence::PlayedSequence(std::vector<SequenceFrame> frames, TrackerListener listener)
    : frames_(std::move(frames)),
      listener_(std::move(listener)),
      thread_([this](const std::stop_token& stop) {
        const RealTime priority;
        listener_.connected();
        const auto hand_over = [this](const IgtlMessage& message) {
          ++messages_;
          listener_.message(message, monotonic_seconds());
        };
        replay(frames_, true, hand_over, stop);
      }) {}

Expected<std::unique_ptr<PlayedSequence>> PlayedSequence::open(const std::filesystem::path& file,
                                                               TrackerListener listener) {
  auto frames = read_sequence(file);
  if (!frames) return tl::unexpected(frames.error());
  if (frames->empty()) return fail(Reason::no_pose, file.string() + ": holds no frame");
  return std::unique_ptr<PlayedSequence>(new PlayedSequence(*std::move(frames), std::move(listener)));
}

TrackerLinkStatus PlayedSequence::status() const {
  return {LinkState::connected, {}, {{"messages", messages_}}};
}

void PlayedSequence::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

}  // namespace helicarm::tracker
