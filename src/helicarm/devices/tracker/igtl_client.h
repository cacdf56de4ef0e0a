// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "helicarm/devices/tracker/tracker_source.h"

namespace helicarm::tracker {

struct IgtlClientOptions {
  std::string address = "127.0.0.1";  ///< numeric
  std::uint16_t port = 18944;
  bool ask_for_tracking = false;  ///< send STT_TDATA on each new connection; many servers need no request
  int interval_ms = 16;        ///< requested interval; 0: as fast as the device, for some without any limit
  double first_pause_s = 0.1;  ///< before the second attempt to connect; doubled with each one
  double last_pause_s = 5;
  double connect_s = 2;  ///< timeout of an attempt
  double silence_s = 5;  ///< reconnect after this time without data; 0: never
};

/// Pause before the next attempt to connect.
inline double next_pause(double pause_s, const IgtlClientOptions& options) {
  return std::min(2 * pause_s, options.last_pause_s);
}

/// Maintains a connection to an OpenIGTLink server on its own thread and reconnects when it ends or becomes
/// silent. The pause between attempts is reset only after a message, so that a server that accepts and
/// disconnects is not flooded.
class IgtlClient final : public TrackerSource {
 public:
  using OnMessage = std::function<void(const IgtlMessage&, double arrival_s)>;

  /// The functions are called on the client's thread; they must not call stop(). `arrival_s` is of
  /// monotonic_seconds(). Fails only with `bad_value` for an address that is not numeric.
  static Expected<std::unique_ptr<IgtlClient>> start(const IgtlClientOptions& options, OnMessage on_message,
                                                     std::function<void()> on_connect = {});
  ~IgtlClient() override;

  /// Counters: "attempts", "connections", "silences" and, over all connections, those of IgtlConnection.
  TrackerLinkStatus status() const override;
  /// Thread-safe; dropped while there is no connection.
  void send(const IgtlMessage& message);
  void stop() override;

 private:
  struct Impl;
  explicit IgtlClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace helicarm::tracker
