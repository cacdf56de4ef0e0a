// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <tl/expected.hpp>

#include "helicarm/devices/receiver/pdu.h"

namespace helicarm::dicom {

struct NegotiationOptions {
  std::string title = "HELICARM";          ///< ours: other called titles are rejected
  std::vector<std::string> peers;          ///< calling titles that are let in; empty: any
  std::uint32_t most_pdu_bytes = 1 << 17;  ///< that we take
};

/// The contexts' answers in the request's order, or why there is no association (PS3.8, 9.3.4). Taken are
/// verification and the storage of X-rays (`is_xray_class`), in the transfer syntaxes that the reader knows.
tl::expected<std::vector<ContextAnswer>, Rejection> negotiate(const AssociationRequest& request,
                                                              const NegotiationOptions& options);

}  // namespace helicarm::dicom
