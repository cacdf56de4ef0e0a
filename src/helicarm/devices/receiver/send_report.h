// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <asio/awaitable.hpp>
#include <asio/ssl/context.hpp>

#include "helicarm/devices/receiver/commitment.h"

namespace helicarm::receiver {

/// Reports on an association of its own, of which this program is the service class provider (role selection,
/// PS3.7 D.3.3.4). Several attempts, `limit_s` each. Returns why the last failed; empty: reported. Closing
/// the executor ends it.
asio::awaitable<std::string> send_report(ReportPeer peer, std::string own_title, CommitmentReport report,
                                         asio::ssl::context* tls, double limit_s);

}  // namespace helicarm::receiver
