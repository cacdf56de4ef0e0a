// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

class PoseBoard;

/// Where poses come from; the address decides on the source (`open_tracker`).
struct TrackerAddress {
  /// Numeric, of an OpenIGTLink server; "ndi:" and that of an NDI tracker; or "file:" and a sequence file.
  std::string address = "127.0.0.1";
  std::uint16_t port = 18944;    ///< of a server; of NDI trackers 8765
  double rate_hz = 60;           ///< requested
  bool ask_for_tracking = true;  ///< some OpenIGTLink servers send nothing else, many need no request
  /// Definitions (.rom) of an NDI tracker's passive tools, by the tools' names.
  std::map<std::string, std::filesystem::path> definitions = {};
};

enum class LinkState { connecting, connected, waiting };
std::string_view code(LinkState state);

struct TrackerLinkStatus {
  LinkState state = LinkState::connecting;
  std::string trouble;  ///< why the last connection ended or failed; empty if none did
  Counters counters;    ///< as the source counts
};

/// Called on the source's thread, one at a time; must not call a member of the source.
struct TrackerListener {
  /// `arrival_s` is of monotonic_seconds(). Whatever a tracker speaks, its poses come as a TDATA, QTDATA,
  /// TRANSFORM or POSITION in mm, its state as a STATUS; they may be wrong in any way, as `PoseBoard` checks.
  std::function<void(const IgtlMessage&, double arrival_s)> message;
  std::function<void()> connected = [] {};  ///< before the first message of each connection
};

/// Hands everything to the board, which outlives the source.
TrackerListener onto(PoseBoard& board);

/// A tracker on its own thread. It reconnects by itself after any loss; the destructor ends the thread.
class TrackerSource {
 public:
  virtual ~TrackerSource() = default;
  virtual TrackerLinkStatus status() const = 0;  ///< thread-safe
  /// Returns at once, with the thread ended: no further calls of the listener.
  virtual void stop() = 0;
};

}  // namespace helicarm::tracker
