// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <tl/expected.hpp>

#include "helicarm/devices/receiver/pdu.h"

namespace helicarm::receiver::dicom {

struct NegotiationOptions {
  std::string title = "HELICARM";          ///< own AE title: other called titles are rejected
  std::vector<std::string> peers;          ///< accepted calling titles; empty: any
  std::uint32_t most_pdu_bytes = 1 << 17;  ///< largest PDU accepted
};

/// Answers to the contexts in the request's order, or the rejection (PS3.8, 9.3.4). Accepted are verification
/// and X-ray storage classes (`is_xray_class`) in the transfer syntaxes that the reader supports, and storage
/// commitment in implicit little endian.
tl::expected<std::vector<ContextAnswer>, Rejection> negotiate(const AssociationRequest& request,
                                                              const NegotiationOptions& options);

}  // namespace helicarm::receiver::dicom
