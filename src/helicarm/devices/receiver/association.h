// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <string>

#include <asio/awaitable.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/ssl/context.hpp>

#include "helicarm/devices/receiver/receiver.h"

namespace helicarm {

/// What all associations share.
struct ReceiverShared {
  ReceiverOptions options;
  Inbox& inbox;
  ReceiverHooks hooks;
  ReceiverCounters counters;
  std::atomic<unsigned> open{0};            ///< connections
  std::atomic<unsigned> associated{0};      ///< those that were accepted
  std::atomic<std::size_t> bytes_taken{0};  ///< of pictures on the way
};

/// Serves one peer until it releases, aborts, breaks the protocol or stalls. Never throws.
asio::awaitable<void> serve(asio::ip::tcp::socket socket, asio::ssl::context* tls, ReceiverShared& shared);

}  // namespace helicarm
