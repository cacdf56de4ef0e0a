// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "helicarm/devices/tracker/tracker_source.h"

namespace helicarm::tracker {

struct NdiClientOptions {
  std::string address = "127.0.0.1";  ///< numeric
  std::uint16_t port = 8765;
  double rate_hz = 60;  ///< of requests; a measurement that was received before is not passed on again
  /// Tool definition (.rom) of each passive tool by the tool's name. Tools on cables bring their own, and are
  /// named by their part number.
  std::map<std::string, std::filesystem::path> definitions = {};
  double first_pause_s = 0.1;  ///< before the second attempt to connect; doubled with each one
  double last_pause_s = 5;
  double connect_s = 2;  ///< timeout of an attempt
  double reply_s = 10;   ///< timeout of the replies that prepare tracking
  double silence_s = 2;  ///< of the replies while tracking
};

/// A tracker by NDI's Combined API over TCP, without a program between: it initialises the device, loads the
/// tools' definitions, enables the tools and asks for poses (BX 0001, TX 0001 where that is unknown) on its
/// own thread. A tool that is missing, or partly outside of the volume in which the device measures, is
/// passed on as hidden. The messages have no time stamp, since the device counts frames and has no clock. It
/// reconnects after any loss.
class NdiClient final : public TrackerSource {
 public:
  /// `bad_value` for an address that is not numeric; `missing_file`, and `bad_size` for an empty definition
  /// or one of over 1024 bytes.
  static Expected<std::unique_ptr<NdiClient>> start(const NdiClientOptions& options,
                                                    TrackerListener listener);
  ~NdiClient() override;

  /// Counters: "attempts", "connections", "replies", "messages", "bad_crc", "repeated" measurements.
  TrackerLinkStatus status() const override;
  void stop() override;

 private:
  struct Impl;
  explicit NdiClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace helicarm::tracker
