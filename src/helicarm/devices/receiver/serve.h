// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <asio/ip/tcp.hpp>
#include <asio/ssl/context.hpp>

#include "helicarm/devices/receiver/association.h"

namespace helicarm {

/// Lets a peer in, where there is room, and serves it on the socket's executor, which must be a strand, until
/// it releases, aborts, breaks the protocol, stalls, or must make room for another.
void serve(asio::ip::tcp::socket socket, asio::ssl::context* tls, ReceiverShared& shared);

}  // namespace helicarm
