// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <asio/ip/tcp.hpp>
#include <asio/ssl/context.hpp>

#include "helicarm/devices/receiver/association.h"

namespace helicarm::receiver {

/// Admits a peer, if the limits allow, and serves it on the socket's executor, which must be a strand, until
/// it releases, aborts, violates the protocol, times out, or is replaced.
void serve(asio::ip::tcp::socket socket, asio::ssl::context* tls, ReceiverShared& shared);

}  // namespace helicarm::receiver
