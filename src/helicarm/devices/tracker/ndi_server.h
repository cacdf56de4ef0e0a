// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

struct NdiServerOptions {
  std::string address = "127.0.0.1";   ///< numeric; the protocol has neither authentication nor encryption
  std::uint16_t port = 0;              ///< 0: any free port
  std::vector<std::string> on_cables;  ///< names of the tools that need no definition; the first 24
  std::size_t most_clients = 8;
};

/// A virtual NDI tracker on its own thread: an `NdiDevice` for each program that connects, which all receive
/// the same measurements.
class NdiServer {
 public:
  /// Listens on return. Fails with `bad_value` (address) and `port_taken`.
  static Expected<std::unique_ptr<NdiServer>> start(const NdiServerOptions& options);
  ~NdiServer();

  std::uint16_t port() const;
  /// The next measurement; other content than TDATA is ignored. Thread-safe.
  void send(const IgtlMessage& message);
  /// "connections", "refused", "commands". Thread-safe.
  Counters counters() const;
  void stop();

 private:
  struct Impl;
  explicit NdiServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace helicarm::tracker
